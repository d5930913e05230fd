"""Photos that nothing but rough cameras is known of, and whose mesh has no edges to be found:
believed where they agree with each other on the surface.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from texproj.camera import Camera
from texproj.errors import InputError
from texproj.photo import Photo
from texproj.records import CameraRecord, Fit
from texproj.register.joint.lenses import PhotoStart
from texproj.register.joint.session import LoadPhoto
from texproj.register.proof.alone import look
from texproj.register.proof.camps import Ruling
from texproj.register.proof.together import LEAST_PHOTOS, Together, brought_together
from texproj.render import GBuffer, Render
from texproj.stages.attending import attended
from texproj.stages.bench import Workbench
from texproj.stages.block_fits import MAX_ERROR_PERCENT, Told
from texproj.stages.entries import start_of
from texproj.stages.lenses import lens_of
from texproj.stages.progress import Progress

STAGE = "agreement"
CHANNELS = ("depth", "normal", "front")
ASKED = 4
"""Photos in which the mesh's edges are sought."""
EDGES_PX = 768
MOST_EDGES = 0.1
"""Share of the mesh's edges found, at half that size, from which on it has edges: a vase and a
cushion have .00 to .02, noisy scans of them .07, a stele .24, its mirror image .21."""
GLANCE_PX = 64
"""Size at which a photo is decoded to see whether it can be."""


def placed_by_agreement(
    bench: Workbench,
    names: Sequence[str],
    registered: Mapping[str, CameraRecord],
    progress: Progress,
) -> Told:
    """A camera for each of the photos `names` that agrees with enough others, from the rough camera
    in its entry; or why there is none. registered: photos that are right already, which stay.
    """
    known = _with_cameras(bench, names, registered)
    own = [name for name in known if name in names]
    if len(known) < LEAST_PHOTOS or not own:
        return {}
    progress(STAGE, 0, 1, "comparing the photos on the surface")
    order, entries = list(known), bench.project.load_cameras()

    def start(name: str) -> PhotoStart:
        before = start_of(entries.get(name))
        lens = lens_of(bench.project, name, before)
        given = before is not None and before.intrinsics is not None
        return PhotoStart(known[name], 0.0, lens, given, name not in names)

    def load(number: int, longest: int) -> Photo:
        return bench.project.load_photo(order[number], longest)

    def render(camera: Camera) -> GBuffer:
        return bench.plain_scene.gbuffer(camera, CHANNELS)

    photos = [start(name) for name in order]
    fixed = [photo.fixed for photo in photos]
    found = brought_together(photos, load, render, bench.project.settings.refine)
    progress(STAGE, 1, 1, "")
    if not any(fixed) and (reason := edges_in_part(found, load, render)):
        return dict.fromkeys(own, reason)
    return {
        order[k]: _told(found.cameras[k], found.expected_error_px[k], ruling, found.start_error_px)
        for k, ruling in found.rulings.items()
    }


def edges_in_part(found: Together, load: LoadPhoto, render: Render) -> str:
    """Why photos that agree are not believed all the same: the mesh has edges that they show, but
    too few of them in place, as of a mirrored mesh of a symmetric thing. Empty where it has none.
    """
    agreeing = [k for k, ruling in found.rulings.items() if ruling.camp >= LEAST_PHOTOS]
    few = agreeing[:: -(-len(agreeing) // ASKED) or 1]
    looks = [look(load(k, EDGES_PX), found.cameras[k], render, EDGES_PX) for k in few]
    share = float(np.mean([one.middle for one in looks])) if looks else 0.0
    if share < MOST_EDGES:
        return ""
    return (
        f"the photos agree on the surface, but only {share:.0%} of the mesh's edges are in place "
        "(is it a mirrored scan, or another one?); pick 8 points in one photo"
    )


def _with_cameras(
    bench: Workbench, names: Sequence[str], registered: Mapping[str, CameraRecord]
) -> dict[str, Camera]:
    """The photos that can be read, with rough cameras or the ones that they are registered at."""
    entries, found = bench.project.load_cameras(), {}
    for name in bench.project.photo_names:
        record = registered.get(name)
        start = start_of(entries.get(name)) if name in names else None
        camera = record.camera if record else (start.camera if start else None)
        if camera is not None and can_be_read(bench, name):
            found[name] = camera
    return found


def can_be_read(bench: Workbench, name: str) -> bool:
    """Whether a photo can be decoded."""
    try:
        attended(name, lambda: bench.project.load_photo(name, GLANCE_PX))
    except InputError:  # its own entry says so
        return False
    return True


def _told(
    camera: Camera, expected_error_px: float, ruling: Ruling, start_error_px: float
) -> Fit | str:
    """The fit of one photo, or why it is not believed."""
    side = max(camera.width, camera.height)
    if ruling.camp < LEAST_PHOTOS or not np.isfinite(expected_error_px):
        return (
            "too few other photos show the same surface where its start puts it (at best "
            f"{ruling.share:.0%} of the patches agree, chance gives {ruling.chance:.0%}); "
            "pick 4 points, or give a closer start"
        )
    nothing = np.zeros(0)
    fit = Fit(
        camera=camera,
        method="block",
        expected_error_px=float(expected_error_px),
        residual_px=nothing,
        inliers=nothing.astype(bool),
        covariance=np.full((6, 6), np.nan),
        quality={"start_error_px": round(start_error_px, 2)},
    )
    percent = 100 * expected_error_px / side
    if percent <= MAX_ERROR_PERCENT:
        return fit
    reason = f"the photos agree, but leave it uncertain by {percent:.2f} % of its longer side"
    return replace(fit, accepted=False, reason=f"{reason}; pick 4 points")
