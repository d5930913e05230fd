"""Points of the surface that want a color: vertices, texels, pixels of a picture."""
