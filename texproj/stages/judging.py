"""Registered photos before each other: who bears whom out on the surface, and what their place on
the mesh rests on.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from texproj.camera import Camera
from texproj.errors import InputError
from texproj.photo import Photo
from texproj.records import CHOSEN, CameraRecord
from texproj.register.block.scan_samples import ScanSamples
from texproj.register.block.slides import WORKING_PX, Slide, slides, untold
from texproj.register.joint.lone import REMEDY
from texproj.register.proof.camps import Ruling
from texproj.register.proof.judge import Looks, LooksHere, judge
from texproj.render import GBuffer
from texproj.resources.workers import WorkerLostError
from texproj.stages.agreeing import can_be_read
from texproj.stages.attending import attended
from texproj.stages.bench import Crew, Workbench
from texproj.stages.judging_tasks import LooksByCrew, views_kept

SURE_SUPPORT = 0.33
"""Share of the mesh's edges in place from which on they bear a photo out."""
ASKED = 4
"""Photos in which the mesh's edges are sought after it was slid along itself."""
MOST_NAMED = 3


@dataclass(frozen=True, eq=False)
class Judgement:
    """What is said of one photo. proof: for its entry; refusal: why it is not believed, empty if it
    is; note: what to mind.
    """

    proof: dict[str, Any]
    refusal: str = ""
    note: str = ""


def judgements(
    bench: Workbench,
    registered: Mapping[str, CameraRecord],
    new: Collection[str],
    crew: Crew | None,
    listen: Callable[[], None],
) -> dict[str, Judgement]:
    """What the registered photos say of those of them that are `new`, which were read just now.
    crew: who looks at the photos, this process alone where it is None; listen: called several times
    a second meanwhile; it may raise to stop the work.
    """
    names = [n for n in registered if n in new or can_be_read(bench, n)]
    if not {*names} & {*new}:
        return {}
    sure = [k for k, name in enumerate(names) if _by_edges(registered[name]) >= SURE_SUPPORT]
    asked = [k for k, name in enumerate(names) if name in new]
    cameras = [_camera(registered[name]) for name in names]

    def judged(looks: Looks) -> dict[int, Ruling]:
        return judge(cameras, looks, asked, sure)

    def told() -> dict[int, Ruling]:
        if crew is None:
            return judged(_looks_here(bench, names, cameras))
        try:
            with views_kept(bench.project) as folder:
                return judged(LooksByCrew(crew, names, cameras, asked, folder, listen))
        except WorkerLostError:
            if crew is bench.crew:  # several workers have ended at it: so would this one
                raise MemoryError from None
            return judged(_looks_here(bench, names, cameras))

    try:
        found = attended("all photos", told)
    except InputError:  # the log has it; a camera is not refused for that
        return {}
    return {names[k]: _judgement(registered[names[k]], one, names) for k, one in found.items()}


def _looks_here(bench: Workbench, names: Sequence[str], cameras: Sequence[Camera]) -> LooksHere:
    def load(number: int, longest: int) -> Photo:
        return bench.project.load_photo(names[number], longest)

    def render(camera: Camera) -> GBuffer:
        return bench.plain_scene.gbuffer(camera, ("depth",))

    return LooksHere(cameras, load, render)


def rests_on(bench: Workbench, registered: Mapping[str, CameraRecord]) -> str:
    """What the photos' place on the mesh rests on where the mesh slides along itself and its edges
    do not tell; empty where it is told.
    """
    motions = mesh_slides(bench)
    names = [n for n in registered if can_be_read(bench, n)] if motions else []
    if not names:
        return ""
    few = [names[k] for k in np.unique(np.linspace(0, len(names) - 1, ASKED).astype(int))]
    photos = [bench.project.load_photo(name, WORKING_PX) for name in few]
    cameras = [_camera(registered[name]) for name in few]
    left = untold(cameras, photos, bench.render, motions)
    if not left:
        return ""
    means = _means(registered)
    return f"the mesh looks the same when {left[0].words}, so the place rests on {means}"


def mesh_slides(bench: Workbench) -> tuple[Slide, ...]:
    """The motions that leave the mesh as it is."""
    samples = ScanSamples.of(bench.mesh)
    xyz = samples.world_from_unit.apply(samples.xyz)
    return slides(xyz, samples.normal.astype(np.float64))


def _camera(record: CameraRecord) -> Camera:
    camera = record.camera
    assert camera is not None
    return camera


def _by_edges(record: CameraRecord) -> float:
    """Share of the mesh's edges that the photo shows in place, as its registration says."""
    support = record.quality.get("support")
    return float(support) if isinstance(support, int | float) else 0.0


def _proof(record: CameraRecord, ruling: Ruling, names: Sequence[str]) -> dict[str, Any]:
    by = []
    if _by_edges(record) >= SURE_SUPPORT:
        by.append("structure")
    if ruling.agree:
        by.append("other photos")
    if record.method == "points":
        by.append("picks")
    if CHOSEN in record.quality:
        by.append("your choice")
    if record.method == "silhouette":
        by.append("outline")
    return {
        "by": by,
        "photos": [names[n] for n in ruling.agree],
        "share": round(ruling.share, 3),
        "chance": round(ruling.chance, 3),
        "against": [names[n] for n in ruling.against],
    }


def _judgement(record: CameraRecord, ruling: Ruling, names: Sequence[str]) -> Judgement:
    """What is said of a photo. Picks are a proof of their own, which a camp of one size does not
    outweigh.
    """
    proof, against = _proof(record, ruling, names), named([names[n] for n in ruling.against])
    if ruling.refused:
        refusal = (
            f"{against} see the same surface and show something else there (at best "
            f"{ruling.share:.0%} of the patches agree with a photo, chance gives "
            f"{ruling.chance:.0%}); {REMEDY}"
        )
        return Judgement(proof, refusal)
    if ruling.torn and record.method != "points":
        refusal = (
            f"it and {against} show different things where they see the same surface, and which"
            " is wrong cannot be told; pick 8 points in both, or check their picks or starts"
        )
        return Judgement(proof, refusal)
    if ruling.against and not ruling.agree:
        note = f"{against} shows something else where both see the same surface"
        return Judgement(proof, note=note)
    return Judgement(proof)


def named(names: Sequence[str]) -> str:
    """Some of the names, and how many more there are."""
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def _means(registered: Mapping[str, CameraRecord]) -> str:
    """What somebody said of where photos are."""
    picked = [n for n, r in registered.items() if r.method == "points"]
    given = [n for n, r in registered.items() if not r.sought]
    started = [n for n, r in registered.items() if r.start is not None and r.start.pose is not None]
    told = []
    if picked:
        told.append(f"your picks in {named(picked)}")
    if given:
        told.append(f"the cameras given for {named(given)}")
    if started and not told:
        told.append(f"the starts given for {named(started)}")
    return " and ".join(told) or "nothing but chance"
