"""A texture and the shape of a mesh carried over to a mesh of fewer faces."""
