"""The flash told from the lens by photos of a white wall."""
