"""A camera from edges of the bare mesh found in the photo."""
