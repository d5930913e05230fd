"""All photos on their way to the surface, here or by workers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from texproj.color.alignment.shift import Alignment, displaced
from texproj.color.balance.shared_points import PointObserver
from texproj.color.points.source import PointSource
from texproj.color.sampling.gather import Projection, project_parts, project_views
from texproj.color.sampling.part import Unusable
from texproj.color.sampling.photo_set import PhotoSet
from texproj.options import ColorOptions
from texproj.resources.scratch import Scratch


class Coming:
    """Photos that are to be projected; here the first is decoded from now on."""

    def __init__(
        self,
        photos: PhotoSet,
        options: ColorOptions,
        found: Sequence[Alignment | Unusable] = (),
    ) -> None:
        """found: their displacements, if any were looked for."""
        self._photos, self._options, self._found = photos, options, found
        here = photos.elsewhere is None
        self._views = displaced(photos.views(options), found) if here else None

    def project(
        self,
        points: PointSource,
        observer: PointObserver,
        scratch: Scratch,
        progress: Callable[[int], None],
    ) -> Projection:
        """The samples of all photos, each of which `observer` sees too. progress: called with the
        number of photos that are done.
        """
        photos, options = self._photos, self._options
        if self._views is not None:
            return project_views(points, self._views, observer, options, scratch, progress)
        assert photos.elsewhere is not None
        cameras = dict(zip(photos.names, photos.cameras, strict=True))
        shifts = [one.shift if isinstance(one, Alignment) else None for one in self._found]
        shifts = shifts or [None] * len(photos)
        parts = photos.elsewhere.parts(points, cameras, shifts, options)
        return project_parts(points, parts, observer, scratch, progress)
