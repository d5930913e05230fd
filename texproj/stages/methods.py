"""Which method finds a photo's camera: the one that was asked for, or, in turn, all that the
project has the means for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, RegistrationError
from texproj.project import Project
from texproj.records import CameraRecord, Fit
from texproj.register.features import Known, register_features
from texproj.register.information.register import register_mutual_information
from texproj.register.outline.chain import ChainOptions, register_from_outline
from texproj.register.picks.register import register_points
from texproj.register.structure.register import register_structure
from texproj.stages.bench import Workbench
from texproj.stages.entries import THROUGH

REGISTRATION_LONGEST = 1024
"""Longer side, pixels, to which photos are reduced for matching."""

NEAREST = 4
"""From how many other cameras a photo without a start of its own is tried."""
MOST_COMPARED = 8
"""With how many other photos the features of a photo are compared."""

Neighbors = Mapping[str, Camera]
"""Registered cameras of other photos by name, those next in the order of names first."""

NOTHING_TO_START_FROM = (
    "nothing to start from: pick at least 4 points, or give an approximate camera in cameras.json"
)


def find_camera(
    bench: Workbench, name: str, start: CameraRecord | None, neighbors: Neighbors
) -> Fit:
    """The camera of photo `name` by the method of the settings, or by its own means: picks, they
    are the surest, then structure from wherever there is a start.

    An unaccepted fit or RegistrationError says why there is none.
    """
    asked = bench.project.settings.register.method
    if asked != "auto":
        return METHODS[asked](bench, name, start, neighbors)
    refusals: list[str] = []
    starts: list[Camera] = []
    if bench.project.correspondences_path(name).is_file():
        fit = _tried(partial(_by_points, bench, name, start, neighbors), refusals, starts)
        if fit is not None:
            return fit
    if start is not None and start.camera is not None:
        starts.append(start.camera)
    return _first([partial(_from_camera, bench, name, camera) for camera in starts], refusals)


def find_by_others(
    bench: Workbench,
    name: str,
    start: CameraRecord | None,
    neighbors: Neighbors,
    earlier: str = "",
) -> Fit:
    """The camera of photo `name` by what other photos show of the same surface, by its outline if
    it has a mask, or by structure from where other photos were taken.

    earlier: why its own means did not find it. Raises RegistrationError.
    """
    others = [_in_place_of(bench.project, name, start, neighbors[n]) for n in neighbors]
    if has_means(bench.project, name, start):
        others = []
    attempts = [partial(_by_features, bench, name, start, neighbors)]
    if bench.project.mask_path(name) is not None:
        attempts.append(partial(_by_silhouette, bench, name, start, neighbors))
    attempts += [partial(_from_camera, bench, name, camera) for camera in others[:NEAREST]]
    fit = _first(attempts, [earlier] if earlier else [])
    on_its_own = f"on its own: {earlier}" if earlier else ""
    return replace(fit, reason="; ".join(filter(None, [fit.reason, on_its_own])))


def has_means(project: Project, name: str, start: CameraRecord | None) -> bool:
    """Whether a photo has picks or a pose to start from, and so needs no other photo."""
    posed = start is not None and start.pose is not None
    return posed or project.correspondences_path(name).is_file()


def _first(attempts: Sequence[Callable[[], Fit]], refusals: list[str]) -> Fit:
    """The first fit that is accepted; RegistrationError with all reasons if none is."""
    for attempt in attempts:
        fit = _tried(attempt, refusals, [])
        if fit is not None:
            return fit
    raise RegistrationError("; ".join(dict.fromkeys(refusals)) or NOTHING_TO_START_FROM)


def _tried(attempt: Callable[[], Fit], refusals: list[str], starts: list[Camera]) -> Fit | None:
    """The fit if it is accepted; else its reason goes to `refusals`, its camera to `starts`."""
    try:
        fit = attempt()
    except RegistrationError as error:
        refusals.append(str(error))
        starts += [error.approximate] if isinstance(error.approximate, Camera) else []
        return None
    if not fit.accepted:
        refusals.append(fit.reason)
        return None
    return fit


def _in_place_of(
    project: Project, name: str, start: CameraRecord | None, neighbor: Camera
) -> Camera:
    """A camera for photo `name` where another photo was taken from."""
    if start is not None and start.intrinsics is not None:
        return Camera(start.intrinsics, neighbor.pose)
    info = project.photo_info(name)
    if (info.width, info.height) == (neighbor.width, neighbor.height):
        return neighbor
    k = neighbor.intrinsics
    focal = info.focal_px or k.fx * max(info.width, info.height) / max(k.width, k.height)
    middle = (info.width / 2, info.height / 2)
    return Camera(Intrinsics(info.width, info.height, focal, focal, *middle), neighbor.pose)


def _by_points(bench: Workbench, name: str, start: CameraRecord | None, _: Neighbors) -> Fit:
    project = bench.project
    picks = project.load_correspondences(name)
    if picks is None:
        path = project.correspondences_path(name)
        raise RegistrationError(f"no picks at {path}; pick at least 4 points")
    prior = start.intrinsics if start else None
    pose = start.pose if start else None
    options = project.settings.points
    info = project.photo_info(name)
    return register_points(info, picks, prior, options, pose, bench.surface_sample)


def _by_structure(bench: Workbench, name: str, start: CameraRecord | None, _: Neighbors) -> Fit:
    if start is None or start.camera is None:
        raise RegistrationError(NOTHING_TO_START_FROM)
    return _from_camera(bench, name, start.camera)


def _from_camera(bench: Workbench, name: str, start: Camera) -> Fit:
    photo = bench.project.load_photo(name, REGISTRATION_LONGEST)
    options = bench.project.settings.structure
    return register_structure(photo, start, bench.render, options)


def _by_features(
    bench: Workbench, name: str, start: CameraRecord | None, neighbors: Neighbors
) -> Fit:
    if not neighbors:
        raise RegistrationError(NOTHING_TO_START_FROM)
    found = {n: _known(bench, n, neighbors[n]) for n in list(neighbors)[:MOST_COMPARED]}
    known = {n: k for n, k in found.items() if k is not None}
    info = bench.project.photo_info(name)
    features = bench.features(name)
    prior = start.intrinsics if start is not None else None
    options = bench.project.settings.points
    near = list(known.values())
    fit = register_features(info, features, near, prior, options, bench.surface_sample)
    return replace(fit, quality={**fit.quality, THROUGH: list(known)})


def _known(bench: Workbench, name: str, camera: Camera) -> Known | None:
    try:
        return bench.known(name, camera)
    except InputError:  # a broken photo helps no other; its own entry says so
        return None


def _by_information(bench: Workbench, name: str, start: CameraRecord | None, _: Neighbors) -> Fit:
    if start is None or start.camera is None:
        raise RegistrationError(NOTHING_TO_START_FROM)
    photo = bench.project.load_photo(name, REGISTRATION_LONGEST)
    options = bench.project.settings.mutual_information
    picks = bench.project.load_correspondences(name)
    return register_mutual_information(photo, start.camera, bench.render, options, picks)


def _by_silhouette(bench: Workbench, name: str, start: CameraRecord | None, _: Neighbors) -> Fit:
    """The views that have the object's outline, told apart and made exact by what is inside."""
    settings = bench.project.settings
    photo = bench.project.load_photo(name, REGISTRATION_LONGEST)
    options = ChainOptions(
        settings.silhouette,
        settings.mutual_information,
        settings.structure,
    )
    prior = (start.camera or start.intrinsics) if start is not None else None
    return register_from_outline(photo, prior, bench.render, bench.mesh, options)


METHODS: dict[str, Callable[[Workbench, str, CameraRecord | None, Neighbors], Fit]] = {
    "points": _by_points,
    "structure": _by_structure,
    "features": _by_features,
    "mutual-information": _by_information,
    "silhouette": _by_silhouette,
}
"""What `--method NAME` does, from what is known beforehand."""
