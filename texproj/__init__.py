"""Color a 3D mesh from loose photographs: registration and color projection, headless."""
