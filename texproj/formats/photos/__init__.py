"""Reading photos: upright, in sRGB or linear light, with their stencil; and what headers tell."""

from typing import TYPE_CHECKING

from texproj.formats.photos.kinds import KINDS, PHOTO_SUFFIXES, PIXELS, RAW_SUFFIXES, SAID
from texproj.loading import when_used

if TYPE_CHECKING:
    from texproj.formats.photos.header import read_photo_info
    from texproj.formats.photos.read import read_photo
    from texproj.formats.photos.thumbnail import read_thumbnail

_HOMES = {
    "read_photo": "texproj.formats.photos.read",
    "read_photo_info": "texproj.formats.photos.header",
    "read_thumbnail": "texproj.formats.photos.thumbnail",
}

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

if not TYPE_CHECKING:  # most of what asks for names of files reads no photo
    __getattr__ = when_used(__name__, _HOMES)
