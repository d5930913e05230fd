"""A camera by mutual information."""
