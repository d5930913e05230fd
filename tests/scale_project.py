"""A project of many photos, half of which failed, as registration leaves it; nothing is solved."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import cv2
import numpy as np

from texproj.camera import Camera, Intrinsics, Pose
from texproj.project import Project
from texproj.records import THROUGH, CameraRecord, Fit
from texproj.register.block.graph import PhotoGraph
from texproj.stages import attempts, registering
from texproj.stages.entries import refined_entry
from texproj.stages.lineage import Sources, inputs, own_cameras
from texproj.stages.methods import Search
from texproj.stages.neighborhood import Neighborhood
from texproj.stages.partners import keep_graph
from texproj.stages.traces import STAGE, Trace, keep_blocks

LENS = Intrinsics(60, 40, 55.0, 55.0, 30.0, 20.0)
IN_SIGHT = 20
"""Photos that show the same as one of a block."""
AFTERWARDS = {
    "refine": {"before": {}, "after": {}, "moved_px": {}, "thrown_out": {}, "quality": {}},
    "color": {"outputs": {}, "used": [], "failed": {}, "quality": {}, "occluders": {}},
    "report": {"outputs": {}},
}
"""Records of stages that were made from nothing that is there now."""
MESH = """ply
format ascii 1.0
element vertex 3
property double x
property double y
property double z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""


def make_photos(root: Path, count: int, side: int = 0) -> Project:
    """A project of so many different small photos, of which nothing is known. side: of square ones
    with a pattern in which features are found, pixels, if not 0.
    """
    for folder in ("mesh", "photos"):
        (root / folder).mkdir(parents=True)
    (root / "mesh" / "scan.ply").write_text(MESH)
    rng = np.random.default_rng(0)
    for k in range(count):
        picture = rng.integers(0, 255, (40, 60, 3), np.uint8)
        if side:
            picture = cv2.resize(picture, (side, side), interpolation=cv2.INTER_CUBIC)
        cv2.imwrite(str(root / "photos" / f"IMG_{k:05d}.png"), picture)
    return Project.open(root)


def make_picked_project(root: Path, count: int) -> Project:
    """A project of so many small photos, in each of which twelve points are picked."""
    project = make_photos(root, count)
    (root / "correspondences").mkdir()
    for k, name in enumerate(project.photo_names):
        (root / "correspondences" / name).with_suffix(".csv").write_text(picks(k))
    return Project.open(root)


def picks(seed: int) -> str:
    """Twelve points in a unit cube four units away, picked a tenth of a pixel off."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-0.5, 0.5, (12, 3))
    uv = LENS.fx * xyz[:, :2] / (xyz[:, 2:] + 4) + (LENS.cx, LENS.cy) + rng.normal(0, 0.1, (12, 2))
    rows = [",".join(map(repr, row.tolist())) for row in np.hstack([uv, xyz])]
    return "\n".join(["u,v,x,y,z", *rows])


def make_scale_project(root: Path, count: int) -> Project:
    """Photos of which every second failed; of the others, half were found through the one before
    it, and all were refined.
    """
    project = make_photos(root, count)
    entries = {}
    for k, name in enumerate(project.photo_names):
        before = project.photo_names[k - 2] if k % 4 == 2 else None
        entries[name] = _registered(name, before) if k % 2 == 0 else _failed(name)
    project.save_cameras(entries.values())
    sources, cameras = Sources(project), own_cameras(entries)
    good = {name for name, entry in entries.items() if entry.registered_camera}
    near = Neighborhood(project.photo_names, good, {})
    for name, entry in entries.items():
        tried = ("structure",) if entry.method == "structure" else ("structure", "features")
        read = inputs(sources, entry, tried, (), cameras, lambda n: near.around(n, lambda _: False))
        project.save_record(STAGE, name, Trace("auto", tried, (), read).as_dict())
    project.save_hashes()
    return project


def make_block_project(root: Path, count: int) -> Project:
    """Photos that were all placed at once, each with `IN_SIGHT` others that show the same; what was
    made of them later is gone, but for its records.
    """
    project = make_photos(root, count)
    names = tuple(project.photo_names)
    entries = {name: _placed(name) for name in names}
    project.save_cameras(entries.values())
    near = [(names[i], names[(i + j) % count]) for i in range(count) for j in range(1, IN_SIGHT)]
    keep_graph(project, PhotoGraph({(min(p), max(p)): 100 for p in near}, frozenset(names)))
    sources, cameras = Sources(project), own_cameras(entries)
    read = {
        name: inputs(sources, entry, ("block",), names, cameras, lambda _: ())
        for name, entry in entries.items()
    }
    traces = {name: Trace("auto", ("block",), names, read[name]) for name in names}
    keep_blocks(project, traces)
    for name, trace in traces.items():
        project.save_record(STAGE, name, trace.as_dict())
    for stage, known in AFTERWARDS.items():
        project.save_record(stage, None, {"inputs": {}, **known})
    project.save_hashes()
    return project


def _placed(name: str) -> CameraRecord:
    quality = {"expected_error_px": 1.0, "reason": ""}
    return CameraRecord(
        name, 60, 40, LENS, Pose.identity(), "registered", "block", quality, sought=True
    )


def _registered(name: str, before: str | None) -> CameraRecord:
    start = CameraRecord(name, 60, 40, LENS, Pose.identity(), "prior")
    method = "features" if before else "structure"
    quality = {"expected_error_px": 1.0, "reason": "", **({THROUGH: [before]} if before else {})}
    own = CameraRecord(
        name, 60, 40, LENS, Pose.identity(), "registered", method, quality,
        sought=True, start=start,
    )  # fmt: skip
    return refined_entry(own, own, False)


def _failed(name: str) -> CameraRecord:
    quality = {"reason": "only 3 points of the photo are found in registered photos"}
    return CameraRecord(name, 60, 40, None, None, "failed", None, quality, sought=True)


def chain(monkeypatch, first: str):
    """Stands in for what photos show: each is found through one that is next to it by name."""
    calls: Counter[str] = Counter()

    def next_to(job) -> list[str]:
        return [n for n in job.neighbors if abs(int(n[4:9]) - int(job.name[4:9])) == 1]

    def by_others(job, earlier, before=None):
        calls[job.name] += 1
        if job.name != first and not next_to(job):
            return Search(None, ("nothing next to it",), ("features",))
        camera = Camera(LENS, Pose(np.eye(3), np.array([0, 0, 4.0])))
        quality = {THROUGH: next_to(job) or ["none"]}
        ok = np.ones(4, bool)
        fit = Fit(camera, "features", 1.0, np.ones(4), ok, np.eye(6), quality=quality)
        return Search(fit, (), ("features",))

    monkeypatch.setattr(registering, "search_by_others", by_others)
    monkeypatch.setattr(registering, "compare_looks", lambda *_: None)
    monkeypatch.setattr(registering, "shared_points", lambda job: len(next_to(job)))
    monkeypatch.setattr(attempts, "as_block", lambda *_: {})
    return calls
