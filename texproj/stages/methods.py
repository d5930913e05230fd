"""Which method finds a photo's camera: the one that was asked for, or, in turn, all that the
project has the means for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, RegistrationError
from texproj.photo import Correspondences
from texproj.project import Project
from texproj.records import THROUGH, CameraRecord, Fit
from texproj.stages.attending import attended
from texproj.stages.bench import Workbench
from texproj.stages.outcomes import CONTRADICTED

REGISTRATION_LONGEST = 1024
"""Longer side, pixels, to which photos are reduced for matching."""

NEAREST = 4
"""From how many other cameras a photo without a start of its own is tried."""
MOST_COMPARED = 8
"""With how many other photos the features of a photo are compared."""

AUTO = "auto"
UNSURE = "how far this camera may be off cannot be told (pick 8 points)"
NOTHING_TO_START_FROM = (
    "nothing to start from: pick 8 points, or give an approximate camera in cameras.json"
)
Attempt = tuple[str, Callable[[], Fit]]
"""A method's name, and what it does."""


@dataclass(frozen=True, eq=False)
class Job:
    """One photo to be registered.

    start: what is known of its camera beforehand; neighbors: registered photos by name, at most
    `MOST_COMPARED`, those that show most of the same first.
    """

    bench: Workbench
    name: str
    start: CameraRecord | None
    neighbors: Mapping[str, CameraRecord]

    @property
    def project(self) -> Project:
        return self.bench.project

    @property
    def start_intrinsics(self) -> Intrinsics | None:
        return self.start.intrinsics if self.start is not None else None

    @property
    def starts_somewhere(self) -> bool:
        """Whether there is a whole camera to start from."""
        return self.start is not None and self.start.camera is not None

    @property
    def has_means(self) -> bool:
        """Whether the photo has picks or a pose to start from, and so needs no other photo."""
        posed = self.start is not None and self.start.pose is not None
        return posed or bool(self.project.picks_files(self.name))


@dataclass(frozen=True, eq=False)
class Search:
    """What came of trying some methods in turn.

    fit: the one that ended it, accepted unless a single method was asked for; refusals: why the
    others are none; tried: the methods; starts: cameras not certain enough to keep.
    """

    fit: Fit | None = None
    refusals: tuple[str, ...] = ()
    tried: tuple[str, ...] = ()
    starts: tuple[Camera, ...] = ()

    @property
    def reason(self) -> str:
        """Why there is no fit: what was refused, or else that there was nothing to try."""
        told = dict.fromkeys(self.refusals)
        told.pop(NOTHING_TO_START_FROM, None)
        return "; ".join(told) or NOTHING_TO_START_FROM

    def then(self, attempts: Iterable[Attempt]) -> Search:
        """This search continued; nothing more is tried where there is a fit already."""
        fit, refusals, tried, starts = self.fit, [*self.refusals], [*self.tried], [*self.starts]
        for method, attempt in attempts if fit is None else ():
            tried.append(method)
            try:
                found = believed(attempt())
            except RegistrationError as error:
                refusals.append(str(error))
                starts += [error.approximate] if isinstance(error.approximate, Camera) else []
                continue
            if found.accepted:
                fit = found
                break
            refusals.append(found.reason)
        return Search(fit, tuple(refusals), tuple(dict.fromkeys(tried)), tuple(starts))


def believed(fit: Fit) -> Fit:
    """The fit, not accepted where it does not tell how far it may be off."""
    if not fit.accepted or math.isfinite(fit.expected_error_px):
        return fit
    return replace(fit, accepted=False, reason=UNSURE)


def search_as_asked(job: Job, method: str) -> Search:
    """By the one method that was asked for. A fit that is not accepted says why."""
    try:
        return Search(believed(METHODS[method](job)), (), (method,))
    except RegistrationError as error:
        return Search(None, (str(error),), (method,))


def search_by_own_means(job: Job) -> Search:
    """By the photo's own means: picks, they are the surest, then structure from wherever there is
    a start.
    """
    search = Search()
    if job.project.picks_files(job.name):
        search = search.then([("points", partial(_by_points, job))])
    given = job.start.camera if job.start is not None else None
    starts = [*search.starts, *([given] if given is not None else [])]
    return search.then(("structure", partial(_from_camera, job, camera)) for camera in starts)


def search_alone(job: Job, method: str) -> Search:
    """By the photo's own means, or by the one method that was asked for."""
    return search_by_own_means(job) if method == AUTO else search_as_asked(job, method)


def is_slow(job: Job, method: str) -> bool:
    """Whether a search of the photo alone takes seconds: picks take no time where they fit."""
    if method in ("points", "silhouette"):
        return method == "silhouette"
    picked = bool(job.project.picks_files(job.name))
    return job.starts_somewhere and not (method == AUTO and picked)


def search_by_others(job: Job, earlier: str, before: Collection[str] | None = None) -> Search:
    """By what other photos show of the same surface, by the outline if there is a mask, or by
    structure from where other photos were taken.

    earlier: why the photo's own means did not find it; before: the photos from whose place it was
    tried already in this run, where it was.
    """
    attempts: list[Attempt] = [("features", partial(_by_features, job))]
    if before is None and job.project.mask_files(job.name):
        attempts.append(("silhouette", partial(_by_silhouette, job)))
    places = [] if job.has_means else [n for n in job.neighbors if n not in (before or ())]
    attempts += [("structure", partial(_from_place_of, job, n)) for n in places[:NEAREST]]
    search = Search(refusals=(earlier,) if earlier else ()).then(attempts)
    against = [why for why in search.refusals if why.endswith(CONTRADICTED)]
    if search.fit is None or not (earlier or against):
        return search
    own = f"on its own: {earlier}" if earlier else ""
    told = "; ".join(filter(None, [search.fit.reason, own, *against]))
    return replace(search, fit=replace(search.fit, reason=told))


def shared_points(job: Job) -> int:
    """How many points of the surface the photo shares with its neighbors; 0 if it cannot be read,
    which is told when it is attended.
    """
    if not job.neighbors:
        return 0
    try:
        attended(job.name, partial(job.bench.features, job.name))
    except InputError:
        return 0
    shared = (attended_pairs(job, other) for other in job.neighbors.values())
    return sum(len(pairs) for pairs in shared if pairs is not None)


def attended_pairs(job: Job, other: CameraRecord) -> Correspondences | None:
    """What the photo shares with a registered one; None where that one helps no other: it is
    broken, and its own entry says so.
    """
    try:
        return attended(other.file, partial(job.bench.pairs, job.name, other))
    except InputError:
        return None


def _place_of(job: Job, neighbor: Camera) -> Camera:
    """A camera for the photo where another photo was taken from."""
    if job.start_intrinsics is not None:
        return Camera(job.start_intrinsics, neighbor.pose)
    info = job.project.photo_info(job.name)
    if (info.width, info.height) == (neighbor.width, neighbor.height):
        return neighbor
    k = neighbor.intrinsics
    focal = info.focal_px or k.fx * max(info.width, info.height) / max(k.width, k.height)
    middle = (info.width / 2, info.height / 2)
    return Camera(Intrinsics(info.width, info.height, focal, focal, *middle), neighbor.pose)


def _by_points(job: Job) -> Fit:
    from texproj.register.picks.register import register_points  # noqa: PLC0415 - slow to load

    picks = job.project.load_correspondences(job.name)
    if picks is None:
        path = job.project.correspondences_path(job.name)
        raise RegistrationError(f"no picks at {path}; pick 8 points")
    pose = job.start.pose if job.start is not None else None
    options = job.project.settings.points
    info = job.project.photo_info(job.name)
    surface = job.bench.surface_sample
    return register_points(info, picks, job.start_intrinsics, options, pose, surface)


def _given(job: Job) -> Camera:
    if job.start is None or job.start.camera is None:
        raise RegistrationError(NOTHING_TO_START_FROM)
    return job.start.camera


def _by_structure(job: Job) -> Fit:
    return _from_camera(job, _given(job))


def _from_place_of(job: Job, name: str) -> Fit:
    camera = job.neighbors[name].camera
    assert camera is not None
    return _from_camera(job, _place_of(job, camera))


def _from_camera(job: Job, start: Camera) -> Fit:
    from texproj.register.structure.register import register_structure  # noqa: PLC0415 - slow to load

    photo = job.project.load_photo(job.name, REGISTRATION_LONGEST)
    options = job.project.settings.structure
    return register_structure(photo, start, job.bench.render, options)


def _by_features(job: Job) -> Fit:
    from texproj.register.features import (  # noqa: PLC0415 - slow to load
        LEAST_INLIERS,
        inherited_error,
        register_pairs,
    )

    if not job.neighbors:
        raise RegistrationError(NOTHING_TO_START_FROM)
    info = job.project.photo_info(job.name)
    job.bench.features(job.name)  # a fault of this photo's is not taken for one of another's
    found = {n: attended_pairs(job, other) for n, other in job.neighbors.items()}
    shared = {n: pairs for n, pairs in found.items() if pairs is not None}
    errors = [expected_error_px(job.neighbors[n]) for n in shared]
    apart = [job.neighbors[n].method == "points" for n in shared]
    inherited = inherited_error([*shared.values()], errors, apart)
    options = job.project.settings.points
    fit = register_pairs(
        info, list(shared.values()), inherited, job.start_intrinsics, options,
        job.bench.surface_sample,
    )  # fmt: skip
    told = sorted(shared, key=lambda name: -len(shared[name]))
    if fit.accepted and sum(len(shared[name]) >= LEAST_INLIERS for name in told) < 2:
        fit = _through_one(job, fit, job.neighbors[told[0]])
    return replace(fit, quality={**fit.quality, THROUGH: list(shared)})


def _through_one(job: Job, fit: Fit, witness: CameraRecord) -> Fit:
    from texproj.stages.single_witness import borne_out  # noqa: PLC0415 - slow to load

    photo = job.project.load_photo(job.name, REGISTRATION_LONGEST)
    options = job.project.settings.structure
    return borne_out(fit, witness, photo, job.bench.render, options, job.bench.surface_sample)


def expected_error_px(record: CameraRecord) -> float:
    """The expected error that an entry tells; 0 where it tells none."""
    return float(record.quality.get("expected_error_px") or 0)


def _by_information(job: Job) -> Fit:
    from texproj.register.information.register import (  # noqa: PLC0415 - slow to load
        register_mutual_information,
    )

    start = _given(job)
    photo = job.project.load_photo(job.name, REGISTRATION_LONGEST)
    options = job.project.settings.mutual_information
    picks = job.project.load_correspondences(job.name)
    return register_mutual_information(photo, start, job.bench.render, options, picks)


def _by_silhouette(job: Job) -> Fit:
    """The views that have the object's outline, told apart and made exact by what is inside."""
    from texproj.register.outline.chain import (  # noqa: PLC0415 - slow to load
        ChainOptions,
        register_from_outline,
    )

    settings = job.project.settings
    photo = job.project.load_photo(job.name, REGISTRATION_LONGEST)
    options = ChainOptions(
        settings.silhouette,
        settings.mutual_information,
        settings.structure,
    )
    prior = (job.start.camera or job.start.intrinsics) if job.start is not None else None
    return register_from_outline(photo, prior, job.bench.render, job.bench.mesh, options)


METHODS: dict[str, Callable[[Job], Fit]] = {
    "points": _by_points,
    "structure": _by_structure,
    "features": _by_features,
    "mutual-information": _by_information,
    "silhouette": _by_silhouette,
}
"""What `--method NAME` does, from what is known beforehand."""

READS: dict[str, tuple[str, ...]] = {
    "points": ("points",),
    "structure": ("structure", "render"),
    "features": ("points", "structure", "render"),
    "mutual-information": ("mutual-information", "render"),
    "silhouette": ("silhouette", "mutual-information", "structure", "render"),
    "block": ("render",),
}
"""The tables of project.toml that each method reads."""
