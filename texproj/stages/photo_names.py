"""Which photo of the project another program's file means by a name."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

from texproj.formats.interchange import ForeignCamera


class PhotoNames:
    """The project's photos, found by what other programs call them."""

    def __init__(self, photos: Iterable[str]) -> None:
        pairs = [(_composed(name), name) for name in photos]
        self._exact = _unique(pairs)
        self._folded = _unique((told.casefold(), name) for told, name in pairs)
        self._stems = _unique((Path(told).stem.casefold(), name) for told, name in pairs)

    def match(self, name: str) -> tuple[str | None, int]:
        """The photo that a file calls `name`, and how loosely: 0 by name, 1 but for upper and
        lower case, 2 by the name without its ending. Folders do not matter, nor whether accents
        are letters of their own (as macOS writes them) or not.
        """
        last = _composed(PurePosixPath(name.replace("\\", "/")).name)
        if last in self._exact:
            return self._exact[last], 0
        if last.casefold() in self._folded:
            return self._folded[last.casefold()], 1
        for stem in (last, PurePosixPath(last).stem):
            if stem.casefold() in self._stems:
                return self._stems[stem.casefold()], 2
        return None, 3

    def photo_of(self, name: str) -> str | None:
        """The photo that a file calls `name`."""
        return self.match(name)[0]


def by_photo(cameras: Iterable[ForeignCamera], names: PhotoNames) -> dict[str, list[ForeignCamera]]:
    """For each photo the cameras whose names fit it best."""
    fitting: dict[str, list[tuple[int, ForeignCamera]]] = {}
    for camera in cameras:
        photo, looseness = names.match(camera.name)
        if photo is not None:
            fitting.setdefault(photo, []).append((looseness, camera))
    return {
        photo: [camera for rank, camera in ranked if rank == min(r for r, _ in ranked)]
        for photo, ranked in fitting.items()
    }


def _composed(name: str) -> str:
    return unicodedata.normalize("NFC", name)


def _unique(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """The pairs whose key appears once."""
    found: dict[str, list[str]] = {}
    for key, value in pairs:
        found.setdefault(key, []).append(value)
    return {key: values[0] for key, values in found.items() if len(values) == 1}
