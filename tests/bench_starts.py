"""All photos of a scene from hard starts at once: what `register` finds, and what it must refuse.

    python tests/bench_starts.py ../shared/data/fountain-P11 ../shared/data/sceaux-castle
        [--what hard,350,mirrored,wrong,lone,pair] [--seeds 1,2,3]

A scene folder holds mesh.ply, photos/ and cameras_reference.json. Starts are the reference cameras
disturbed at random (`bench_registration.disturbed`), for each seed others.

| what | the project | must |
|---|---|---|
| hard | 300 to 400 px, up to 15 degrees of roll, 30 % of depth, 5 % (deviation) of the focal | |
| | length wrong at once | have all photos within .3 % of the width |
| 350 | 350 px and 5 % of focal length wrong, roughly an orbit | the same |
| mirrored | the mesh with left and right exchanged, starts 120 px from where the picture's | |
| | mirror image fits | have no photo registered |
| wrong | the mesh of the next scene, starts where this one's block would lie on it | have none |
| pair | two photos that overlap, one 120 px off, nothing known of the other | have none wrong |
| lone | one photo, 120 px off, mesh right and mirrored | have none wrong |

Errors: mean distance of the surface that faces the reference camera, percent of the width, median
and largest over the registered photos; then how many are registered though more than .5 % off. The
last line counts all runs together.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from bench_registration import disturbed
from block_errors import by_centers
from block_scenes import error_percent, mirrored

from texproj.camera import Camera, Pose
from texproj.files import write_atomically
from texproj.formats.cameras import cameras_json, read_cameras
from texproj.formats.meshes import read_mesh
from texproj.formats.models.ply import write_ply
from texproj.mesh import Mesh, vertex_normals
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.repair import repair
from texproj.stages.bench import Workbench
from texproj.stages.registering import register_photos

WITHIN_PERCENT, WRONG_PERCENT = 0.3, 0.5
MIRROR = np.diag([-1.0, 1, 1])


@dataclass(frozen=True, eq=False)
class Scene:
    """A mesh, the points of it that errors are measured at, and reference cameras."""

    folder: Path
    mesh: Mesh
    points: np.ndarray
    normals: np.ndarray
    cameras: dict[str, Camera]

    @classmethod
    def of(cls, folder: Path) -> Scene:
        mesh = repair(*read_mesh(folder / "mesh.ply")).mesh
        pick = np.random.default_rng(0).permutation(len(mesh.vertices))[:10_000]
        records = read_cameras(folder / "cameras_reference.json").records
        cameras = {r.file: r.camera for r in records if r.camera}
        return cls(folder, mesh, mesh.vertices[pick], vertex_normals(mesh)[pick], cameras)

    def off_percent(self, name: str, found: Camera) -> float:
        return error_percent(found, self.cameras[name], self.points, self.normals)

    def starts(self, kind: str, seed: int) -> dict[str, Camera]:
        """A start of a kind for each photo."""
        return {
            name: disturbed(
                camera, self.points, kind, np.random.default_rng([seed, zlib.crc32(name.encode())])
            )
            for name, camera in self.cameras.items()
        }


@dataclass(frozen=True, eq=False)
class Case:
    """A project: a scene's photos, a mesh, cameras to start from. right: whether they belong
    together; needed: the share of the photos that must be registered.
    """

    label: str
    scene: Scene
    mesh: Mesh
    photos: Sequence[str]
    starts: Mapping[str, Camera]
    right: bool = True
    needed: float = 1.0

    def run(self) -> Told:
        """Registered, and held against the reference."""
        with tempfile.TemporaryDirectory() as root:
            project = self._made(Path(root))
            begun = time.perf_counter()
            with Workbench(project) as bench:
                outcomes = register_photos(bench)
            spent = time.perf_counter() - begun
            entries = project.load_cameras()
        found = {o.name: entries[o.name].camera for o in outcomes if not o.failed}
        off = {
            name: self.scene.off_percent(name, camera) if self.right else np.inf
            for name, camera in found.items()
        }
        refused = {o.name: o.reason for o in outcomes if o.failed}
        return Told(self, off, refused, spent)

    def _made(self, root: Path) -> Project:
        for name in ("mesh", "photos"):
            (root / name).mkdir()
        write_ply(root / "mesh" / "scan.ply", self.mesh.vertices, self.mesh.faces, None)
        for name in self.photos:
            shutil.copy(self.scene.folder / "photos" / name, root / "photos" / name)
        records = [
            CameraRecord(name, c.width, c.height, c.intrinsics, c.pose, "prior")
            for name, c in self.starts.items()
        ]
        write_atomically(root / "cameras.json", cameras_json(records))
        return Project.open(root)


@dataclass(frozen=True, eq=False)
class Told:
    """off: percent of the width, of the registered photos; refused: why the others are not."""

    case: Case
    off: dict[str, float]
    refused: dict[str, str]
    seconds: float

    @property
    def wrong(self) -> int:
        """Photos that are registered though they are nowhere near."""
        return sum(off > WRONG_PERCENT for off in self.off.values())

    @property
    def met(self) -> bool:
        within = sum(off < WITHIN_PERCENT for off in self.off.values())
        return not self.wrong and within >= self.case.needed * len(self.case.photos)

    def line(self) -> str:
        off = list(self.off.values())
        errors = f"{np.median(off):.3f} / {max(off):.3f} %" if off else "-"
        verdict = "WRONG" if self.wrong else "met" if self.met else "NOT MET"
        return (
            f"{self.case.label:>44}: {len(off):2d} of {len(self.case.photos):2d} registered,"
            f" {errors}, {self.wrong} wrong, {self.seconds:.0f} s | {verdict}"
        )


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--what", default="hard,350,mirrored,wrong,pair,lone")
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("-v", "--verbose", action="store_true", help="why photos are refused")
    options = parser.parse_args()
    scenes = [Scene.of(folder) for folder in options.scenes]
    told: list[Told] = []
    for what in options.what.split(","):
        for number, scene in enumerate(scenes):
            other = scenes[(number + 1) % len(scenes)]
            for seed in map(int, options.seeds.split(",")):
                for case in cases(what, scene, other, seed):
                    told.append(case.run())
                    print(told[-1].line(), flush=True)
                    for name, why in told[-1].refused.items() if options.verbose else ():
                        print(f"        {name}: {why}", flush=True)
    photos = sum(len(one.case.photos) for one in told)
    print(
        f"{len(told)} projects of {photos} photos: {sum(len(one.off) for one in told)} registered,"
        f" {sum(one.wrong for one in told)} of them wrong by more than {WRONG_PERCENT} %;"
        f" {sum(one.met for one in told)} projects as they must be"
    )


def cases(what: str, scene: Scene, other: Scene, seed: int) -> Iterator[Case]:
    """The projects of a kind."""
    label, names = f"{scene.folder.name} {what}, seed {seed}", list(scene.cameras)
    if what in ("hard", "350"):
        starts = scene.starts(f"{what}f", seed)
        yield Case(label, scene, scene.mesh, names, starts)
    if what == "mirrored":
        yield Case(label, scene, mirrored(scene.mesh), names, flipped(scene.starts("120", seed)),
                   False, 0)  # fmt: skip
    if what == "wrong" and other is not scene:
        shown, there = list(scene.cameras.values()), list(other.cameras.values())
        few = min(len(shown), len(there))
        carried = by_centers(shown[:few], there[:few])
        starts = {n: carried.camera(c) for n, c in scene.starts("120", seed).items()}
        yield Case(label, scene, other.mesh, names, starts, False, 0)
    if what == "pair":
        first = (3 * seed) % (len(names) - 1)
        two = names[first : first + 2]
        for few, word in ((two, "first known"), (two[::-1], "second known")):
            starts = {few[0]: scene.starts("120", seed)[few[0]]}
            yield Case(f"{label}, {word}", scene, scene.mesh, two, starts, needed=0)
            yield Case(f"{label}, {word}, mirrored", scene, mirrored(scene.mesh), two,
                       flipped(starts), False, 0)  # fmt: skip
    if what == "lone":
        name = names[(3 * seed) % len(names)]
        starts = {name: scene.starts("120", seed)[name]}
        yield Case(label, scene, scene.mesh, [name], starts, needed=0)
        yield Case(f"{label}, mirrored", scene, mirrored(scene.mesh), [name], flipped(starts),
                   False, 0)  # fmt: skip


def flipped(cameras: Mapping[str, Camera]) -> dict[str, Camera]:
    """Cameras that see a mirrored mesh as the given ones see the right one, left and right
    exchanged.
    """
    return {
        name: replace(c, pose=Pose(MIRROR @ c.pose.R @ MIRROR, MIRROR @ c.pose.t))
        for name, c in cameras.items()
    }


if __name__ == "__main__":
    main()
