"""The web page on which results are judged and correspondences picked."""
