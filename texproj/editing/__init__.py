"""What a person made, changed by a program without losing anything of it."""
