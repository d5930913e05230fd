"""The version that is installed."""

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as _installed

try:
    __version__ = _installed("texproj")
except PackageNotFoundError:  # a bare checkout
    __version__ = "0+checkout"
