"""Many photos, nothing else: how long each step of `texproj run` takes, and how much memory.

    python tests/bench_many.py ../shared/data/fountain-P11 [--photos 100] [--longest 1920]
        [--keep FOLDER]

The photos are taken of the scene's mesh (`many_photos.py`) and kept in FOLDER, where the project is
left, too. For each step: processor seconds, those of COLMAP's process included, seconds on the
clock, peak MB of this process and of COLMAP's. Then the error of the cameras, percent of the width,
as they are and with one common similarity taken out. Floor: 100 photos of 6 MP in 20 minutes on two
idle cores. Linux only.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from block_errors import best_similarity, offsets_px, visible
from many_photos import Place

from texproj.camera import Camera
from texproj.formats.cameras import read_cameras
from texproj.formats.models.ply import write_ply
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.coloring import color_project
from texproj.stages.refining import refine_project
from texproj.stages.registering import register_photos
from texproj.stages.reporting import report_project

TICKS = os.sysconf("SC_CLK_TCK")


def processor_s() -> float:
    """Of this process and its children, those that still run included."""
    used = sum(sum(resource.getrusage(who)[:2]) for who in (0, resource.RUSAGE_CHILDREN))
    return used + sum(_ticks(stat) for stat in _children()) / TICKS


def _children() -> list[list[str]]:
    """What /proc tells of the processes that this one has started, from their parent on."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            told = path.read_text().rsplit(")", 1)[1].split()
        except OSError:  # it has ended
            continue
        if int(told[1]) == os.getpid():
            found.append(told)
    return found


def _ticks(stat: list[str]) -> int:
    return int(stat[11]) + int(stat[12])


class Clock:
    """Prints a line whenever another step begins."""

    def __init__(self) -> None:
        self.what, self.wall, self.cpu = "", time.perf_counter(), processor_s()

    def __call__(self, stage: str, done: int, total: int, _name: str) -> None:
        if stage != self.what:
            self.begin(stage)

    def begin(self, what: str) -> None:
        wall, cpu = time.perf_counter(), processor_s()
        if self.what and cpu - self.cpu > 0.5:
            own, child = (
                resource.getrusage(who).ru_maxrss / 1024 for who in (0, resource.RUSAGE_CHILDREN)
            )
            print(
                f"{self.what:>46}: {cpu - self.cpu:6.1f} s of processor time,"
                f" {wall - self.wall:6.1f} s, {own:5.0f} and {child:5.0f} MB",
                flush=True,
            )
        self.what, self.wall, self.cpu = what, wall, cpu


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", type=Path)
    parser.add_argument("--photos", type=int, default=100)
    parser.add_argument("--longest", type=int, default=1920)
    parser.add_argument("--keep", type=Path, help="keep photos and project here")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        measured(options.keep or Path(scratch), options)


def measured(root: Path, options: argparse.Namespace) -> None:
    with ProcessPoolExecutor(1) as apart:  # whose memory is not counted
        true, vertices = apart.submit(made, root, options).result()
    project = Project.open(root)
    clock, begun = Clock(), (time.perf_counter(), processor_s())
    steps: tuple[Callable[..., object], ...] = (
        lambda bench, progress: register_photos(bench, progress=progress),
        refine_project,
        color_project,
        report_project,
    )
    for step in steps:
        with Workbench(project) as bench:
            step(bench, clock)
        clock.begin("-")
    wall, cpu = time.perf_counter() - begun[0], processor_s() - begun[1]
    print(f"{'all':>46}: {cpu:6.1f} s of processor time, {wall:6.1f} s")
    print(exactness(project, true, vertices))


def made(root: Path, options: argparse.Namespace) -> tuple[dict[str, Camera], np.ndarray]:
    """The folder of a project; the true cameras, and (n, 3) vertices of the mesh."""
    place = Place.of(options.scene)
    (root / "mesh").mkdir(parents=True, exist_ok=True)
    vertices, faces = np.asarray(place.solid.vertices), np.asarray(place.solid.faces)
    write_ply(root / "mesh" / "scan.ply", vertices, faces, None)
    return dict(place.written(root / "photos", options.photos, options.longest)), vertices


def exactness(project: Project, true: dict[str, Camera], vertices: np.ndarray) -> str:
    """How far the registered cameras are from the true ones."""
    records = {r.file: r.registered_camera for r in read_cameras(project.cameras_path).records}
    found = {name: camera for name, camera in records.items() if camera is not None}
    wanted = [true[name] for name in found]
    seen = [visible(camera, vertices) for camera in wanted]
    common = best_similarity(list(found.values()), wanted, seen)

    def off(cameras: list[Camera]) -> np.ndarray:
        sets = zip(cameras, wanted, seen, strict=True)
        return np.array([100 * np.median(offsets_px(a, b, xyz)) / b.width for a, b, xyz in sets])

    apart, left = off(list(found.values())), off([common.camera(c) for c in found.values()])
    return (
        f"{len(found)} of {len(true)} registered; {np.median(apart):.3f} / {apart.max():.3f} %,"
        f" a similarity taken out {np.median(left):.3f} / {left.max():.3f} %"
    )


if __name__ == "__main__":
    main()
