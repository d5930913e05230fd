"""Reading photos: upright, in sRGB or linear light, with their stencil; and what headers tell."""

from texproj.formats.photos.header import PHOTO_SUFFIXES, read_photo_info
from texproj.formats.photos.read import read_photo

__all__ = ["PHOTO_SUFFIXES", "read_photo", "read_photo_info"]
