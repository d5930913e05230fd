"""What the machine lends: threads, memory, scratch space."""
