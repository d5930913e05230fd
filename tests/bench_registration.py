"""Registration on real scenes: how often, how exactly, how fast, and how honestly.

    python tests/bench_registration.py SCENE_FOLDER ... [--seeds 1,2] [--starts 120,200f,hard]

A scene folder holds mesh.ply, photos/ and cameras_reference.json (a cameras.json). Starts are
the reference cameras disturbed at random: a number is the mean image motion in full-size
pixels, `hard` is depth +-30 %, roll +-15 degrees and 300 to 400 pixels at once, a final f adds
5 % of focal error (standard deviation). Wrong starts are counted apart: the photo mirrored, the
camera of a far photo, and, where two scenes are given, a photo of the other scene; there a
camera is right only if it is within 0.5 % of the width. Errors: mean distance, full-size
pixels, between the images of mesh vertices by the found and by the reference camera, over
vertices that face the reference camera inside the picture.
"""

from __future__ import annotations

import argparse
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from texproj.camera import Camera, Pose
from texproj.errors import RegistrationError
from texproj.formats.cameras import read_cameras
from texproj.formats.meshes import read_mesh
from texproj.formats.photos.header import read_photo_info
from texproj.formats.photos.read import read_photo
from texproj.mesh import Mesh, vertex_normals
from texproj.photo import Photo
from texproj.records import Fit
from texproj.register.structure.register import register_structure
from texproj.render import Render, ambient_occlusion, open_renderer
from texproj.repair import repair

Register = Callable[[Photo, Camera, Render], Fit]
METHODS: dict[str, Register] = {"structure": register_structure}
WRONG_PERCENT = 0.5


@dataclass(frozen=True)
class RealScene:
    """A mesh, its renderer and photos (reduced) with reference cameras (full size)."""

    name: str
    render: Render
    points: np.ndarray
    normals: np.ndarray
    photos: dict[str, Photo]
    cameras: dict[str, Camera]

    def error_px(self, camera: Camera, reference: Camera) -> float:
        """Mean image distance over what the reference camera sees facing it."""
        xy, depth = reference.project(self.points)
        toward = ((reference.center - self.points) * self.normals).sum(1) > 0
        seen = reference.inside(xy) & (depth > 0) & toward
        gap = np.linalg.norm(camera.project(self.points[seen])[0] - xy[seen], axis=1)
        return float(np.nan_to_num(gap, nan=1e6).mean())


@dataclass(frozen=True)
class Run:
    """One registration: its start, outcome and cost. error_px: inf where no camera was given."""

    photo: str
    start: str
    start_px: float
    error_px: float
    percent: float
    claimed_px: float
    accepted: bool
    seconds: float
    reason: str


def main() -> None:
    arguments = parsed()
    register = METHODS[arguments.method]
    scenes = [load(folder, arguments.photos) for folder in arguments.scenes]
    for scene in scenes:
        print(f"\n{scene.name}: {len(scene.photos)} photos, method {arguments.method}")
        print(HEAD)
        for kind in arguments.starts.split(","):
            seeds = [int(seed) for seed in arguments.seeds.split(",")]
            report(kind, list(right_runs(scene, kind, seeds, register)), arguments.verbose)
        others = [other for other in scenes if other is not scene]
        for kind, runs in wrong_runs(scene, others, register):
            report(kind, runs, arguments.verbose)


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--method", choices=METHODS, default="structure")
    parser.add_argument("--starts", default="120,200,120f,200f,hard,hardf")
    parser.add_argument("--seeds", default="1")
    parser.add_argument("--photos", type=int, default=1, help="every n-th photo")
    parser.add_argument("-v", "--verbose", action="store_true", help="one line per run")
    return parser.parse_args()


def load(folder: Path, every: int) -> RealScene:
    records = read_cameras(folder / "cameras_reference.json").records[::every]
    mesh = repair(*read_mesh(folder / "mesh.ply")).mesh
    pick = np.random.default_rng(0).permutation(len(mesh.vertices))[:20_000]
    cameras = {r.file: r.camera for r in records if r.camera}
    return RealScene(
        folder.name,
        renderer(mesh),
        mesh.vertices[pick],
        vertex_normals(mesh)[pick],
        {name: photo(folder / "photos" / name) for name in cameras},
        cameras,
    )


def renderer(mesh: Mesh) -> Render:
    scene = open_renderer().load(mesh, ambient_occlusion(mesh))
    return lambda camera: scene.gbuffer(camera, ("depth", "normal", "ao", "front"))


def photo(path: Path, longest: int = 768) -> Photo:
    return read_photo(path, read_photo_info(path), longest=longest)


def right_runs(scene: RealScene, kind: str, seeds: list[int], register: Register) -> Iterator[Run]:
    for name, camera in scene.cameras.items():
        for seed in seeds:
            rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
            start = disturbed(camera, scene.points, kind, rng)
            yield run(scene, (name, kind), scene.photos[name], start, register)


def wrong_runs(
    scene: RealScene, others: list[RealScene], register: Register
) -> Iterator[tuple[str, list[Run]]]:
    names = list(scene.cameras)
    rng = np.random.default_rng(7)
    near = {name: disturbed(scene.cameras[name], scene.points, "120", rng) for name in names}

    def runs(kind: str, chosen: list[tuple[str, Photo, Camera]]) -> tuple[str, list[Run]]:
        return kind, [run(scene, (n, kind), p, c, register) for n, p, c in chosen]

    yield runs("mirrored", [(n, mirrored(scene.photos[n]), near[n]) for n in names])
    far = {n: scene.cameras[names[(i + len(names) // 2) % len(names)]] for i, n in enumerate(names)}
    yield runs("far view", [(n, scene.photos[n], far[n]) for n in names])
    for other in others:
        strange = list(other.photos.values())
        chosen = [(n, strange[i % len(strange)], near[n]) for i, n in enumerate(names)]
        yield runs(other.name, [(n, p, fitted(c, p)) for n, p, c in chosen])


def run(
    scene: RealScene, label: tuple[str, str], picture: Photo, start: Camera, register: Register
) -> Run:
    name, kind = label
    reference = scene.cameras[name]
    begin = time.perf_counter()
    try:
        fit = register(picture, start, scene.render)
    except RegistrationError as error:
        seconds = time.perf_counter() - begin
        return Run(name, kind, np.nan, np.inf, np.inf, np.nan, False, seconds, str(error))
    seconds = time.perf_counter() - begin
    sizes = (start.width, start.height) == (reference.width, reference.height)
    right_picture = picture is scene.photos[name] and sizes
    error = scene.error_px(fit.camera, reference) if right_picture else np.inf
    moved = scene.error_px(start, reference) if right_picture else np.nan
    percent = 100 * error / reference.width
    claimed = fit.expected_error_px
    return Run(name, kind, moved, error, percent, claimed, fit.accepted, seconds, fit.reason)


HEAD = (
    f"{'start':>14} {'runs':>5} {'median px':>10} {'max px':>9} {'<.1 %':>6} {'<.3 %':>6} "
    f"{'refused':>8} {'of right':>9} {'wrong yet accepted':>19} {'true/claimed':>13} {'s':>6}"
)


def report(kind: str, runs: list[Run], verbose: bool) -> None:
    error, percent = np.array([r.error_px for r in runs]), np.array([r.percent for r in runs])
    accepted = np.array([r.accepted for r in runs])
    right = percent < WRONG_PERCENT
    ratio = np.median([r.error_px / r.claimed_px for r in runs if r.accepted] or [np.nan])
    print(
        f"{kind:>14} {len(runs):5d} {np.median(error):10.2f} {error.max():9.2f} "
        f"{(percent < 0.1).mean():6.0%} {(percent < 0.3).mean():6.0%} {(~accepted).sum():8d} "
        f"{(~accepted & right).sum():9d} {(accepted & ~right).sum():19d} {ratio:13.2f} "
        f"{np.mean([r.seconds for r in runs]):6.2f}",
        flush=True,
    )
    for r in runs if verbose else ():
        verdict = "registered" if r.accepted else f"failed: {r.reason}"
        print(
            f"    {r.photo} from {r.start_px:.0f} px: {r.error_px:.2f} px, "
            f"claimed {r.claimed_px:.2f}, {r.seconds:.2f} s, {verdict}"
        )


def disturbed(camera: Camera, points: np.ndarray, kind: str, rng: np.random.Generator) -> Camera:
    """A start of a kind: '120', 'hard', with 'f' for a focal error."""
    size = kind.removesuffix("f")
    if size == "hard":
        start = hard_start(camera, points, rng)
    else:
        start = moved_start(camera, points, float(size), rng)
    factor = 1 + 0.05 * rng.standard_normal() if kind.endswith("f") and kind != "f" else 1.0
    k = start.intrinsics
    return replace(start, intrinsics=replace(k, fx=k.fx * factor, fy=k.fy * factor))


def moved_start(
    camera: Camera, points: np.ndarray, size_px: float, rng: np.random.Generator
) -> Camera:
    """A random turn about what is seen and a random step, scaled to a mean image motion."""
    seen = in_picture(camera, points)
    pivot = camera.pose.apply(seen).mean(0)
    turn, shift = rng.standard_normal(3), rng.standard_normal(3) * np.linalg.norm(pivot)

    def at(amount: float) -> Camera:
        R = rotation(turn * amount)
        t = R @ (camera.pose.t - pivot) + pivot + shift * amount
        return replace(camera, pose=Pose(R @ camera.pose.R, t))

    low, high = 0.0, 0.5
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if motion(at(middle), camera, seen) < size_px else (low, middle)
    return at(low)


def hard_start(camera: Camera, points: np.ndarray, rng: np.random.Generator) -> Camera:
    """Depth, roll, a small orbit and a shift of the aim, all wrong."""
    depth = float(np.median(camera.pose.apply(in_picture(camera, points))[:, 2]))
    ahead = np.array([0, 0, depth])
    orbit = rotation(np.append(rng.uniform(-1, 1, 2) * np.radians(4), 0))
    R, t = orbit @ camera.pose.R, orbit @ (camera.pose.t - ahead) + ahead * rng.uniform(0.7, 1.3)
    angle, size = rng.uniform(0, 2 * np.pi), rng.uniform(300, 400) / camera.intrinsics.fx
    aim = rotation(size * np.array([np.sin(angle), np.cos(angle), 0]))
    turn = aim @ rotation(np.array([0, 0, np.radians(rng.uniform(-15, 15))]))
    return replace(camera, pose=Pose(turn @ R, turn @ t))


def in_picture(camera: Camera, points: np.ndarray) -> np.ndarray:
    xy, depth = camera.project(points)
    return points[camera.inside(xy) & (depth > 0)]


def motion(camera: Camera, other: Camera, points: np.ndarray) -> float:
    gap = np.linalg.norm(camera.project(points)[0] - other.project(points)[0], axis=1)
    return float(np.nan_to_num(gap, nan=1e6).mean())


def rotation(vector: np.ndarray) -> np.ndarray:
    return cv2.Rodrigues(np.asarray(vector, float).reshape(3, 1))[0]


def mirrored(picture: Photo) -> Photo:
    return replace(picture, pixels=np.ascontiguousarray(picture.pixels[:, ::-1]))


def fitted(camera: Camera, picture: Photo) -> Camera:
    """The camera for a photo of another size."""
    return camera.resized(picture.info.width, picture.info.height)


if __name__ == "__main__":
    main()
