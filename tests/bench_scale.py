"""How long bookkeeping takes as photos grow (not collected).

    python tests/bench_scale.py [PHOTOS ...]      by default 250 500 1000

For each number processor seconds of: `texproj status` where half of the photos failed, and where
all were placed at once and everything after is stale; the lineage alone; `texproj register` where
nothing is stale; and whom `refine` compares with whom, of photos all around a ball. Floor: 2 s for
status of 1000 photos, and each photo among 1000 at most 1.2 times what it takes among 250.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh
from scale_project import make_block_project, make_scale_project

from texproj.camera import Camera, Intrinsics, Pose
from texproj.mesh import Mesh
from texproj.options import RefineOptions, RenderOptions
from texproj.project import Project
from texproj.register.joint.overlap import choose_partners, shared_views
from texproj.render import open_renderer
from texproj.stages.lineage import registration_freshness


def processor_s(*words: str) -> float:
    """Processor time of a command, its start included."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "texproj", *words], stdout=subprocess.DEVNULL, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    print("photos  status s  of a block s  lineage s  no-op register s  partners s")
    for count in map(int, sys.argv[1:] or ("250", "500", "1000")):
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder) / "many"
            make_scale_project(root, count)
            status = processor_s("status", str(root))
            begin = time.process_time()
            registration_freshness(Project.open(root))
            alone = time.process_time() - begin
            again = processor_s("register", str(root))
            make_block_project(Path(folder) / "block", count)
            block = processor_s("status", str(Path(folder) / "block"))
        print(
            f"{count:6d}  {status:8.2f}  {block:12.2f}  {alone:9.2f}  {again:16.2f}"
            f"  {partners_s(count):10.2f}"
        )


def partners_s(count: int) -> float:
    """Of finding out which photos of a ball see the same."""
    rng = np.random.default_rng(0)
    lens = Intrinsics(600, 400, 700.0, 700.0, 300.0, 200.0)
    cameras = [Camera(lens, towards_origin(rng.normal(size=3))) for _ in range(count)]
    ball = trimesh.creation.icosphere(4)
    mesh = Mesh(ball.vertices, ball.faces)
    with open_renderer(RenderOptions()) as renderer, renderer.load(mesh) as scene:
        begin = time.process_time()
        seen = shared_views(cameras, lambda camera: scene.gbuffer(camera, ("depth", "normal")))
        choose_partners(*seen, RefineOptions().partners)
        return time.process_time() - begin


def towards_origin(direction: np.ndarray) -> Pose:
    """A camera four units away that looks at the middle."""
    back = direction / np.linalg.norm(direction)
    right = np.cross([0.0, 1.0, 0.1], -back)
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(-back, right), -back])
    return Pose(R, -R @ (4 * back))


if __name__ == "__main__":
    main()
