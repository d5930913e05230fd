"""How much a photo counts at a point: by the surface, and by the picture."""
