"""Color a 3D mesh from loose photographs: registration and color projection, headless."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("texproj")
except PackageNotFoundError:  # a bare checkout
    __version__ = "0+checkout"
