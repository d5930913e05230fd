"""A flash beside the camera, in a dark room: materials, and the color of each point."""
