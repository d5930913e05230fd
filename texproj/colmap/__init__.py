"""COLMAP as a program of its own: the only place that knows pycolmap."""
