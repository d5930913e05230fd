"""Views that were made long before they are used wait on disk."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.color.scratch import Scratch
from texproj.color.view import PhotoView


@dataclass(frozen=True)
class _Place:
    start: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]


class ParkedView:
    """A view whose images are on disk until it is taken back."""

    def __init__(self, view: PhotoView) -> None:
        self._scratch = Scratch()
        self._fields = {f.name: self._parked(getattr(view, f.name)) for f in fields(view)}

    def take(self) -> PhotoView:
        """The view; the disk space goes back."""
        with closing(self._scratch):
            return PhotoView(**{name: self._back(value) for name, value in self._fields.items()})

    def _parked(self, value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(self._parked(part) for part in value)
        if not isinstance(value, np.ndarray):
            return value
        start = self._scratch.append(np.ascontiguousarray(value).data.cast("B"))
        return _Place(start, value.shape, value.dtype)

    def _back(self, value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(self._back(part) for part in value)
        return self._image(value) if isinstance(value, _Place) else value

    def _image(self, place: _Place) -> NDArray[Any]:
        size = int(np.prod(place.shape)) * place.dtype.itemsize
        data = self._scratch.read(place.start, size)
        return np.frombuffer(data, place.dtype).reshape(place.shape)
