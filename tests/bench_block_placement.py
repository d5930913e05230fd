"""Blocks of photos put onto meshes of real scenes: how exactly, how surely, how fast.

    python tests/bench_block_placement.py SCENE_FOLDER ... [--blocks FOLDER] [--seeds 1,2]
        [--runs right,partial,wrong,mirrored] [--walls 20] [--twins 3]

A scene folder holds mesh.ply, photos/ and cameras_reference.json. Blocks are read from
FOLDER/SCENE.pkl (`bench_block.py --keep`); without, they are made of the reference cameras and
points of the mesh with noise and outliers. Mesh and block are put into a random frame each.
partial: a third of the mesh cut away, a fifth of its faces left, .2 % of its diagonal noise;
wrong: the mesh of each other scene; mirrored: left and right of the mesh exchanged. --walls: so
many blocks of synthetic reliefs on the next relief, or, every fourth, on their own mirrored, only
at the sizes that would fit. --twins: so many reliefs that look the same upside down, without and
with a word about which way is up.

Columns: error against the reference cameras in percent of the width, median and largest over
photos, and what the fit expected; share of the structure found in place; the same of the best
rival; Student's t of the mirror test; processor and wall seconds of the placement, ambient
occlusion included; peak MB of the whole process.
"""

from __future__ import annotations

import argparse
import pickle
import resource
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pymeshlab
import trimesh
from block_scenes import Wall, block_of, error_percent, mirrored, moved, random_similarity

from texproj.camera import Camera
from texproj.errors import RegistrationError
from texproj.formats.cameras import read_cameras
from texproj.formats.meshes import read_mesh
from texproj.formats.photos.header import read_photo_info
from texproj.formats.photos.read import read_photo
from texproj.mesh import Mesh, vertex_normals
from texproj.photo import Photo
from texproj.register.block import search
from texproj.register.block.block_fit import BlockFit
from texproj.register.block.light_mesh import light_mesh
from texproj.register.block.place import Beforehand, place_block
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.similarity import Similarity
from texproj.render import ambient_occlusion, open_renderer
from texproj.repair import repair

Vector = tuple[float, float, float]
LONGEST = 1024
WALL_UP = (0.0, -1.0, 0.0)
FITTING = (0.97, 0.88, 1.07)
"""Sizes of the blocks of reliefs relative to them."""
HEAD = (
    f"{'block on mesh':>32} {'seed':>4} {'error %':>13} {'expected':>8} {'support':>7} "
    f"{'rival':>6} {'t':>6} {'s':>5} {'wall':>5} {'MB':>5}  verdict"
)


@dataclass(frozen=True, eq=False)
class RealScene:
    """A mesh, reference cameras of its photos, and a block of them in any frame."""

    folder: Path
    mesh: Mesh
    cameras: dict[str, Camera]
    block: Reconstruction | None

    def photo(self, name: str) -> Photo:
        path = self.folder / "photos" / name
        return read_photo(path, read_photo_info(path), longest=LONGEST)

    def block_in_frame(self, frame: Similarity, seed: int) -> Reconstruction:
        if self.block is None:
            solid = trimesh.Trimesh(self.mesh.vertices, self.mesh.faces, process=False)
            return block_of(solid, self.cameras, frame, 4000, seed)
        b = self.block
        cameras = tuple(frame.camera(camera) for camera in b.cameras)
        return Reconstruction(
            b.names, cameras, b.lenses, frame.apply(b.points), b.error_px, b.angle_rad,
            b.track_starts, b.observer, b.xy_px,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class WallScene(RealScene):
    """A synthetic relief and its photos."""

    wall: Wall

    @classmethod
    def of(cls, seed: int, twofold: bool = False) -> WallScene:
        wall = Wall(seed, twofold)
        return cls(Path(f"wall {seed}"), wall.mesh, wall.cameras, None, wall)

    def photo(self, name: str) -> Photo:
        return self.wall.photo(name)


def main() -> None:
    arguments = parsed()
    scenes = [load(folder, arguments.blocks) for folder in arguments.scenes]
    print(HEAD)
    for run in arguments.runs.split(","):
        for scene in scenes:
            for seed in (int(s) for s in arguments.seeds.split(",")):
                for label, mesh in meshes(run, scene, scenes, seed):
                    place(scene, label, mesh, seed, right=run in ("right", "partial"))
    if arguments.walls or arguments.twins:
        search.SCALE_BATCHES = (FITTING,)
    for k in range(arguments.twins):
        twin = WallScene.of(k, twofold=True)
        place(twin, "twin", twin.mesh, k, right=True)
        place(twin, "twin, up is known", twin.mesh, k, right=True, up=WALL_UP)
    for k in range(arguments.walls):
        mesh = mirrored(Wall(k).mesh) if k % 4 == 3 else Wall(k + 1).mesh
        label = "mirrored" if k % 4 == 3 else f"wall {k + 1}"
        place(WallScene.of(k), label, mesh, k, right=False)


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--blocks", type=Path)
    parser.add_argument("--seeds", default="1")
    parser.add_argument("--runs", default="right")
    parser.add_argument("--walls", type=int, default=0)
    parser.add_argument("--twins", type=int, default=0)
    return parser.parse_args()


def load(folder: Path, blocks: Path | None) -> RealScene:
    records = read_cameras(folder / "cameras_reference.json").records
    mesh = repair(*read_mesh(folder / "mesh.ply")).mesh
    block = None if blocks is None else pickle.loads((blocks / f"{folder.name}.pkl").read_bytes())
    return RealScene(folder, mesh, {r.file: r.camera for r in records if r.camera}, block)


def meshes(
    run: str, scene: RealScene, scenes: list[RealScene], seed: int
) -> list[tuple[str, Mesh]]:
    """What the block of a scene is put on, by name."""
    if run == "right":
        return [("its own", scene.mesh)]
    if run == "partial":
        return [("part of its own", partial(scene.mesh, seed))]
    if run == "mirrored":
        return [("mirrored", mirrored(scene.mesh))]
    return [(other.folder.name, other.mesh) for other in scenes if other is not scene]


def partial(mesh: Mesh, seed: int) -> Mesh:
    """Two thirds of a mesh on one side of a plane, coarse and noisy."""
    rng = np.random.default_rng(seed)
    height = mesh.vertices @ rng.standard_normal(3)
    kept = (height > np.quantile(height, 1 / 3))[mesh.faces].all(axis=1)
    work = pymeshlab.MeshSet()
    work.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces[kept]))
    work.meshing_decimation_quadric_edge_collapse(targetperc=0.2, preserveboundary=True)
    work.meshing_remove_unreferenced_vertices()
    coarse = work.current_mesh()
    noise = 0.002 * mesh.diagonal / np.sqrt(3) * rng.standard_normal((coarse.vertex_number(), 3))
    return Mesh(coarse.vertex_matrix() + noise, coarse.face_matrix())


@dataclass(frozen=True, eq=False)
class Placing:
    """What came of placing a block: the fit, or why there is none; errors: of its photos against
    the reference, percent of the width, none on a wrong mesh; seconds of processor time and wall.
    """

    fit: BlockFit | None
    reason: str
    errors: tuple[float, ...]
    cpu: float
    wall: float

    @property
    def accepted(self) -> bool:
        return self.fit is not None and self.fit.accepted

    def line(self, label: str, seed: int) -> str:
        """A line of the table."""
        if self.fit is None:
            return f"{label:>32} {seed:4d} {self.cpu:5.0f} {self.wall:5.0f}  refused {self.reason}"
        fit, errors = self.fit, self.errors or (np.nan,)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        verdict = "accepted" if fit.accepted else "refused"
        return (
            f"{label:>32} {seed:4d} "
            f"{np.median(errors):6.3f}/{max(errors):6.3f} {fit.expected_error_percent:8.3f} "
            f"{fit.support:7.2f} {fit.rival:6.2f} {fit.mirror_t:6.1f} {self.cpu:5.0f} "
            f"{self.wall:5.0f} {peak:5.0f}  {verdict} {fit.reason}"
        )


def place(
    scene: RealScene, label: str, mesh: Mesh, seed: int, right: bool, up: Vector | None = None
) -> Placing:
    """Prints one line of the table."""
    found = placed(scene, mesh, seed, right, up)
    print(found.line(f"{scene.folder.name[:13]} on {label}", seed), flush=True)
    return found


def placed(
    scene: RealScene, mesh: Mesh, seed: int, right: bool, up: Vector | None = None
) -> Placing:
    """The block of a scene put onto a mesh, each in a random frame. up: in the scene's."""
    rng = np.random.default_rng(seed)
    world_from_scene, block_from_scene = random_similarity(rng), random_similarity(rng)
    block = scene.block_in_frame(block_from_scene, seed)
    mesh = moved(mesh, world_from_scene)
    known = Beforehand(up=None if up is None else world_from_scene.R @ up)
    fit, reason = None, ""
    with open_renderer() as renderer:
        cpu, wall = time.process_time(), time.perf_counter()
        light = light_mesh(mesh)
        with renderer.load(light, ambient_occlusion(light)) as drawn:
            try:
                fit = place_block(
                    block, mesh, lambda c: drawn.gbuffer(c, ("depth", "normal", "ao", "front")),
                    scene.photo, known=known, seed=seed,
                )  # fmt: skip
            except RegistrationError as error:
                reason = str(error)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    judged = right and fit is not None
    errors = errors_percent(scene, world_from_scene, fit.cameras) if judged else []
    return Placing(fit, reason, tuple(errors), cpu, wall)


def errors_percent(
    scene: RealScene, world_from_scene: Similarity, cameras: dict[str, Camera]
) -> list[float]:
    step = max(1, len(scene.mesh.vertices) // 5000)
    points = world_from_scene.apply(scene.mesh.vertices[::step])
    normals = vertex_normals(moved(scene.mesh, world_from_scene))[::step]
    return [
        error_percent(cameras[name], world_from_scene.camera(camera), points, normals)
        for name, camera in scene.cameras.items()
        if name in cameras
    ]


if __name__ == "__main__":
    main()
