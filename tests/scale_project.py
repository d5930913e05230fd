"""A project of many photos, half of which failed, as registration leaves it; nothing is solved."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from texproj.camera import Intrinsics, Pose
from texproj.project import Project
from texproj.records import THROUGH, CameraRecord
from texproj.stages.entries import refined_entry
from texproj.stages.lineage import Sources, inputs, own_cameras
from texproj.stages.neighborhood import Neighborhood
from texproj.stages.traces import STAGE, Trace

LENS = Intrinsics(60, 40, 55.0, 55.0, 30.0, 20.0)
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


def make_photos(root: Path, count: int) -> Project:
    """A project of so many different small photos, of which nothing is known."""
    for folder in ("mesh", "photos"):
        (root / folder).mkdir(parents=True)
    (root / "mesh" / "scan.ply").write_text(MESH)
    rng = np.random.default_rng(0)
    for k in range(count):
        picture = rng.integers(0, 255, (40, 60, 3), np.uint8)
        cv2.imwrite(str(root / "photos" / f"IMG_{k:05d}.png"), picture)
    return Project.open(root)


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
