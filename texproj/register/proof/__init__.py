"""Whether cameras that somebody else found are right, asked of the photos and the mesh alone."""
