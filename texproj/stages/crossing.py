"""Pairs of photos through parallel and crossed polarizers, and the surface that they tell of."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from texproj.arrays import Bools, Floats
from texproj.camera import Camera
from texproj.errors import InputError
from texproj.formats.photos import read_photo, read_photo_info
from texproj.intake import one_of
from texproj.photo import Photo
from texproj.project import CROSSED_FOLDER, Project
from texproj.stages.attending import attended
from texproj.stages.bench import Workbench
from texproj.stages.coloring import photo_set
from texproj.stages.freshness import Inputs

if TYPE_CHECKING:
    from texproj.appearance.flash.lamp import Lamp
    from texproj.appearance.recovered import Appearance
    from texproj.appearance.sightings import Readings
    from texproj.color.sampling.photo_set import PhotoSet
    from texproj.resources.scratch import Scratch
    from texproj.stages.progress import Progress

SAME_SHAPE = 0.01
"""Largest relative difference of two pictures' ratios of width to height."""


@dataclass(frozen=True, eq=False)
class PhotoPairs:
    """parallel, crossed: photos of the same names and cameras; exposure: (p,) by how much more
    light each crossed one gathered, as EXIF tells, else 1; failed: photos without a usable partner,
    and why, and files that are no partner of any; photos that cannot be read join them when they
    are read.
    """

    parallel: PhotoSet
    crossed: PhotoSet
    exposure: Floats
    failed: dict[str, str]

    def without(self, names: Collection[str]) -> PhotoPairs:
        """The pairs but those of some photos, which cannot be read."""
        rows = [n for n, name in enumerate(self.crossed.names) if name not in names]
        left = [name for name in self.crossed.names if name not in names]
        parallel, crossed = self.parallel.subset(left), self.crossed.subset(left)
        return PhotoPairs(parallel, crossed, self.exposure[rows], self.failed)


def photo_pairs(project: Project, cameras: Mapping[str, Camera]) -> PhotoPairs:
    """The pairs of the registered photos. Raises InputError where there is none."""
    from texproj.color.sampling.photo_set import PhotoSet  # noqa: PLC0415 - slow to load

    failed: dict[str, str] = {}
    exposure, kept = [], {}
    for name, camera in cameras.items():
        try:
            exposure.append(_exposure(project, name))
            kept[name] = camera
        except InputError as error:
            failed[name] = str(error)
    for note in project.crossed.notes:
        failed[note.split(" is ignored")[0]] = note
    if not kept:
        unfit = [failed[name] for name in cameras if name in project.crossed.paths]
        if unfit:
            raise InputError(f"no crossed photo can be used: {'; '.join(unfit)}")
        raise InputError(
            f"no photo has a partner in {project.root / CROSSED_FOLDER}; put each photo's crossed"
            " one there, under its name"
        )

    def read(name: str) -> Photo:
        return attended(name, partial(_loaded, project, name))

    crossed = PhotoSet(tuple(kept), tuple(kept.values()), read)
    parallel = photo_set(project, kept)

    def noted(name: str) -> Photo:
        try:
            return parallel.read(name)
        except InputError as error:
            failed[name] = str(error)
            raise

    told = np.array(exposure, np.float32)
    return PhotoPairs(replace(parallel, read=noted), crossed, told, failed)


def _loaded(project: Project, name: str) -> Photo:
    """The partner of a photo, upright, with that photo's mask. Raises InputError."""
    path, settings = one_of(project.crossed, name), project.settings
    assert path is not None
    info = read_photo_info(path, settings.largest_photo_mp)
    mask = project.mask_path(name)
    masks = [mask] if mask is not None and mask.is_file() else []
    return read_photo(path, info, masks, None, settings.largest_photo_mp, settings.develop)


def _exposure(project: Project, name: str) -> float:
    """By how much more light the partner of a photo gathered. Raises InputError without one."""
    path = one_of(project.crossed, name)
    if path is None:
        raise InputError(f"no photo of its name in {project.root / CROSSED_FOLDER}; it is left out")
    info, other = project.photo_info(name), read_photo_info(path, project.settings.largest_photo_mp)
    if abs(info.width * other.height / (info.height * other.width) - 1) > SAME_SHAPE:
        raise InputError(
            f"{path} has {other.width} x {other.height} pixels and {name} {info.width} x"
            f" {info.height}; take both without moving the camera"
        )
    if info.exposure_ev is None or other.exposure_ev is None:
        return 1.0
    return float(2 ** (other.exposure_ev - info.exposure_ev))


def crossed_inputs(project: Project) -> Inputs:
    """The crossed photos, where the settings ask for them; of several partners all."""
    if project.settings.light.kind != "polarized":
        return {}
    found = project.crossed
    claims = {
        name: found.several.get(name) or (found.paths.get(name),) for name in project.photo_names
    }
    return {
        f"crossed {name}": " ".join(project.hash_of(path) or "none" for path in paths)
        for name, paths in claims.items()
    }


def with_mirrors(
    bench: Workbench, pairs: PhotoPairs, appearance: Appearance, blend: Floats, progress: Progress
) -> Appearance:
    """An appearance that the crossed photos told, with what is mirrored beside it; blend: (V, 3)
    their colors, which stay where the two sets are no pairs.
    """
    from texproj.appearance.polarized.soft_mirror import pairs_of, with_mirror  # noqa: PLC0415
    from texproj.resources.scratch import Scratch  # noqa: PLC0415

    if appearance.irradiance is None:
        return appearance
    with closing(Scratch()) as scratch:
        parallel, crossed = (
            _readings(bench, photos, scratch, progress)
            for photos in (pairs.parallel, pairs.crossed)
        )
        refusal = pairs_of(parallel, crossed, pairs.exposure).refusal
        if refusal:
            refused = replace(appearance, accepted=False, reason=refusal, light=None)
            return replace(refused, base=np.clip(blend, 0, 1), irradiance=None, absolute=False)
        return with_mirror(bench.mesh, appearance, parallel, crossed, pairs.exposure)


def _readings(bench: Workbench, photos: PhotoSet, scratch: Scratch, progress: Progress) -> Readings:
    from texproj.appearance.sightings import Readings  # noqa: PLC0415 - slow to load

    def tell(done: int) -> None:
        progress("mirrors", done, len(photos), "")

    return Readings.of(bench.mesh, photos, bench.renderer, scratch, tell)


def by_polarized_flash(
    bench: Workbench, pairs: PhotoPairs, lamp: Lamp, blend: tuple[Floats, Bools],
    progress: Progress,
) -> Appearance:  # fmt: skip
    """The surface under a flash through a polarizer; blend: what the crossed photos agree on, and
    where they see anything.
    """
    from texproj.appearance.polarized.by_flash import (  # noqa: PLC0415 - slow to load
        Crossed,
        Sets,
        polarized_flash_appearance,
    )

    def tell(what: str, done: int, total: int) -> None:
        progress(what, done, total, "")

    sets = Sets(pairs.parallel, pairs.crossed, pairs.exposure)
    return polarized_flash_appearance(bench.mesh, sets, bench.renderer, lamp, Crossed(*blend), tell)
