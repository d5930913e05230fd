"""A project on this machine alone and on a cluster of local processes: the same, and how fast.

    python tests/bench_cluster.py [PROJECT] [--workers 3] [--kill] [--loose] [--copies]

Without PROJECT a synthetic one of 8 photos with starts is made, with --loose of 12 without, so that
features and pairs are found by workers, too. The stages run here, then on a Dask cluster, in copies
of the project; with --kill a worker is killed in the middle of each stage, and of features and
pairs; with --copies the workers do not see the project folder and are sent its files.

For each stage: seconds on the clock here and there. Then how far the cameras and the textures are
apart: floor 1e-9 and 1 of 255.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from texproj.demo import write_demo
from texproj.options import DemoOptions
from texproj.project import Project
from texproj.resources.cluster import Cluster, cluster_at
from texproj.stages import sites
from texproj.stages.bench import Workbench
from texproj.stages.coloring import color_project
from texproj.stages.refining import refine_project
from texproj.stages.registering import register_photos
from texproj.stages.sites import crew_of
from texproj.version import __version__

DEMO = DemoOptions(
    object="stele", photos=8, starts=True, paint=1, long_side=800, faces=20_000,
    carved_faces=100_000,
)  # fmt: skip
STAGES: dict[str, Callable[..., object]] = {
    "register": lambda bench, tell: register_photos(bench, progress=tell),
    "refine": refine_project,
    "color": color_project,
}


class Killer:
    """Ends one worker once in each stage, when the stage has begun to tell how far it is."""

    def __init__(self, cluster: Cluster | None) -> None:
        self.cluster = cluster
        self.met: set[str] = set()

    def __call__(self, stage: str, done: int, _total: int, _item: str) -> None:
        if self.cluster is None or stage in self.met or done < 1:
            return
        self.met.add(stage)
        pids = self.cluster.everywhere(os.getpid)
        os.kill(next(iter(pids.values())), signal.SIGKILL)
        print(f"      {stage}: killed one of {len(pids)} workers")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("project", nargs="?", type=Path)
    parser.add_argument("--workers", type=int, default=3)
    for flag in ("--kill", "--loose", "--copies"):
        parser.add_argument(flag, action="store_true")
    options = parser.parse_args()
    if options.copies:
        sites._looked_at = unseen
    with tempfile.TemporaryDirectory() as scratch:
        first = Path(scratch) / "first"
        if options.project is None:
            write_demo(first, DemoOptions() if options.loose else DEMO)
        else:
            leave = shutil.ignore_patterns("work", "out")
            shutil.copytree(options.project, first, ignore=leave)
        other = Path(shutil.copytree(first, Path(scratch) / "other"))
        here = staged(first, None, Killer(None))
        with cluster_at(f"local:{options.workers}") as cluster:
            there = staged(other, cluster, Killer(cluster if options.kill else None))
        for name in STAGES:
            print(f"{name:>10}: {here[name]:6.1f} s here, {there[name]:6.1f} s there")
        print(f"cameras apart by {cameras_apart(first, other):.1e}, "
              f"images by {images_apart(first, other)} of 255")  # fmt: skip


def unseen(_root: Path) -> tuple[str, bool]:
    """What workers say that do not see the folder."""
    return __version__, False


def staged(root: Path, cluster: Cluster | None, killer: Killer) -> dict[str, float]:
    """Seconds of each stage."""
    seconds = {}
    for name, stage in STAGES.items():
        project, begun = Project.open(root), time.perf_counter()
        if cluster is None:
            with Workbench(project) as bench:
                stage(bench, killer)
        else:
            with crew_of(cluster, project) as crew, Workbench(project, crew) as bench:
                stage(bench, killer)
        seconds[name] = time.perf_counter() - begun
    return seconds


def cameras_apart(first: Path, other: Path) -> float:
    """The largest difference of any number of any camera."""
    a, b = (Project.open(root).load_cameras() for root in (first, other))
    assert a.keys() == b.keys()
    assert all(a[n].status == b[n].status and a[n].method == b[n].method for n in a)
    pairs = [(a[n].camera, b[n].camera) for n in a if a[n].camera is not None]
    return max(
        max(
            np.abs(p.pose.R - q.pose.R).max(),
            np.abs(p.pose.t - q.pose.t).max(),
            np.abs(np.subtract(p.intrinsics.dist, q.intrinsics.dist)).max(),
            abs(p.intrinsics.fx - q.intrinsics.fx) / p.intrinsics.fx,
        )
        for p, q in pairs
    )


def images_apart(first: Path, other: Path) -> int:
    """The largest difference of any pixel of any image in out/."""
    files = sorted(p.name for p in (first / "out").iterdir() if p.suffix in (".jpg", ".png"))
    pairs = [[cv2.imread(str(r / "out" / n)).astype(int) for r in (first, other)] for n in files]
    return max(int(np.abs(a - b).max()) for a, b in pairs) if pairs else -1


if __name__ == "__main__":
    main()
