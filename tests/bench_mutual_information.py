"""Mutual information and silhouettes on uniform matte pieces with known cameras.

    python tests/bench_mutual_information.py [--kinds stele,capital] [--seeds 0,1] [--views 3]
        [--start-px 30] [--long-side 768] [--starts 1] [--silhouette] [--automatic-mask]

Photos by the ray caster of the demo (not the renderer under test): shadows of the sun, light of
the sky, sensor noise, plain background; the mesh is a scan of 20 k faces with 0.4 mm noise.
Starts: the true camera turned and shifted at random, so that the seen surface moves by so many
pixels of the photo on average; with --silhouette no start but the lens, and the true mask or, with
--automatic-mask, none. Errors: mean distance between images of the seen vertices, percent of the
width. Times are of the processor, user and system.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import cv2
import numpy as np
from scenes import PAIR, Synthetic, scan_of, scene_of, taken

from texproj.camera import Camera
from texproj.demo.photographer import ShotOptions
from texproj.demo.sensor import Sensor
from texproj.demo.views import disturbed
from texproj.errors import RegistrationError
from texproj.mesh import vertex_normals
from texproj.photo import Photo
from texproj.records import Fit
from texproj.register.information.register import register_mutual_information
from texproj.register.outline.chain import register_from_outline
from texproj.render import Render, ambient_occlusion, open_renderer

WRONG_PERCENT = 0.5


@dataclass(frozen=True)
class Run:
    """One registration; percent: error of the width; claimed: expected error, the same."""

    name: str
    before: float
    percent: float
    claimed: float
    accepted: bool
    seconds: float
    note: str


def main() -> None:
    arguments = parsed()
    cv2.setNumThreads(1)
    runs = []
    for kind, seed in product(arguments.kinds.split(","), arguments.seeds.split(",")):
        for run in runs_of(kind, int(seed), arguments):
            runs.append(run)
            print(
                f"{run.name:>22} {run.before:6.2f} % -> {run.percent:7.3f} %, claimed "
                f"{run.claimed:.3f} %, {run.seconds:5.2f} s, "
                f"{'registered' if run.accepted else 'failed: ' + run.note}",
                flush=True,
            )
    summary(runs)


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--kinds", default="stele,capital")
    parser.add_argument("--seeds", default="0,1", help="of the pieces")
    parser.add_argument("--views", type=int, default=3)
    parser.add_argument("--starts", default="1", help="seeds of the starts")
    parser.add_argument("--start-px", type=float, default=30)
    parser.add_argument("--long-side", type=int, default=768)
    parser.add_argument("--silhouette", action="store_true")
    parser.add_argument("--automatic-mask", action="store_true")
    parser.add_argument("--wrong", action="store_true", help="mirror the photos: all must fail")
    return parser.parse_args()


def runs_of(kind: str, seed: int, arguments: argparse.Namespace) -> Iterator[Run]:
    shots = [ShotOptions(background="gradient", sensor=Sensor(full_well=4000))] * arguments.views
    views = PAIR[: arguments.views]
    scene = taken(
        scene_of(kind, seed, matte=True), scan_of(kind, seed), views, shots,
        arguments.long_side, seed,
    )  # fmt: skip
    loaded = open_renderer().load(scene.mesh, ambient_occlusion(scene.mesh))

    def render(camera: Camera):  # type: ignore[no-untyped-def]
        return loaded.gbuffer(camera, ("depth", "normal", "ao", "front"))

    for view in range(arguments.views):
        photo = scene.photos[view]
        if arguments.wrong:
            photo = replace(photo, pixels=np.ascontiguousarray(photo.pixels[:, ::-1]))
        for start in arguments.starts.split(","):
            yield one(scene, view, photo, int(start), render, arguments)


def one(
    scene: Synthetic, view: int, photo: Photo, seed: int, render: Render,
    arguments: argparse.Namespace,
) -> Run:  # fmt: skip
    truth, points = scene.cameras[view], seen_points(scene, view)
    start = disturbed(truth, points, arguments.start_px, np.random.default_rng([seed, view, 9]))
    mask = None if arguments.automatic_mask else scene.masks[view] > 0
    register: Callable[[], Fit] = lambda: register_mutual_information(photo, start, render)  # noqa: E731
    if arguments.silhouette:
        register = lambda: register_from_outline(  # noqa: E731
            photo, truth.intrinsics, render, scene.mesh, mask=mask
        )
    begin, name = time.process_time(), f"{photo.info.name} start {seed}"
    before = np.nan if arguments.silhouette else percent_off(truth, start, points)
    try:
        fit = register()
    except RegistrationError as error:
        seconds = time.process_time() - begin
        return Run(name, before, np.inf, np.nan, False, seconds, str(error))
    seconds = time.process_time() - begin
    error = percent_off(truth, fit.camera, points)
    claimed = 100 * fit.expected_error_px / truth.width
    if arguments.wrong:
        error = np.inf
    return Run(name, before, error, claimed, fit.accepted, seconds, fit.reason)


def seen_points(scene: Synthetic, view: int) -> np.ndarray:
    toward = scene.cameras[view].center - scene.mesh.vertices
    return scene.mesh.vertices[(toward * vertex_normals(scene.mesh)).sum(1) > 0][::7]


def percent_off(truth: Camera, camera: Camera, points: np.ndarray) -> float:
    gap = np.linalg.norm(camera.project(points)[0] - truth.project(points)[0], axis=1)
    return 100 * float(np.nan_to_num(gap, nan=1e6).mean()) / truth.width


def summary(runs: list[Run]) -> None:
    error = np.array([r.percent for r in runs])
    accepted = np.array([r.accepted for r in runs])
    ratio = np.array([r.percent / r.claimed for r in runs if r.accepted])
    print(
        f"{len(runs)} runs: median {np.median(error):.3f} %, max {error.max():.3f} %; within .3 %: "
        f"{(error < 0.3).mean():.0%}, within 2 %: {(error < 2).mean():.0%}; registered "
        f"{accepted.mean():.0%}; wrong yet registered: {(accepted & (error > WRONG_PERCENT)).sum()}"
        f"; true/claimed median {np.median(ratio) if len(ratio) else np.nan:.2f}; "
        f"{np.mean([r.seconds for r in runs]):.2f} s (max {max(r.seconds for r in runs):.2f})"
    )


if __name__ == "__main__":
    main()
