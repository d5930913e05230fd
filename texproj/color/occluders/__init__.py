"""What stands between a camera and the piece: somebody who walked into the picture, a tree."""
