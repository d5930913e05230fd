"""Finding the camera of a photo in the frame of the mesh."""
