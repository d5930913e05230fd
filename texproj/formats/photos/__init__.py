"""Reading photos: upright, in sRGB or linear light, with their stencil; and what headers tell."""

from texproj.formats.photos.header import read_photo_info
from texproj.formats.photos.kinds import KINDS, PHOTO_SUFFIXES, PIXELS, RAW_SUFFIXES, SAID
from texproj.formats.photos.read import read_photo
from texproj.formats.photos.thumbnail import read_thumbnail

__all__ = [
    "KINDS",
    "PHOTO_SUFFIXES",
    "PIXELS",
    "RAW_SUFFIXES",
    "SAID",
    "read_photo",
    "read_photo_info",
    "read_thumbnail",
]
