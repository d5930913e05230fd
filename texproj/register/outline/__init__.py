"""A camera from the outline of the object."""
