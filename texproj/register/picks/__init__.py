"""A camera from picked pairs of pixels and mesh points."""
