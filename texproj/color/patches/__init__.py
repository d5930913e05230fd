"""A texture of patches, each cut from one photo."""
