"""Photos that are at hand as a set, as the color recipes take them."""

from __future__ import annotations

from collections.abc import Sequence

from texproj.camera import Camera
from texproj.color.sampling.photo_set import PhotoSet
from texproj.errors import InputError
from texproj.photo import Photo


def photo_set(cameras: Sequence[Camera], photos: Sequence[Photo | None]) -> PhotoSet:
    """Photos by the names "0", "1", ...; None stands for one that cannot be read."""
    names = tuple(str(number) for number in range(len(cameras)))

    def read(name: str) -> Photo:
        photo = photos[int(name)]
        if photo is None:
            raise InputError(f"photo {name} is damaged")
        return photo

    return PhotoSet(names, tuple(cameras), read)
