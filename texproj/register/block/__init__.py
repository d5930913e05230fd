"""Photos that know each other's places, as one block, put onto the mesh."""
