"""Images of the mesh from any camera, by OpenGL or by ray casting."""
