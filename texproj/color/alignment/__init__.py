"""Small displacements of photos on the surface."""
