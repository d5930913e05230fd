"""Loose photos of real scenes and a mesh, nothing else: what is found, what is refused.

    python tests/bench_block.py ../shared/data/fountain-P11 ../shared/data/sceaux-castle
        [--what motion,all,four,partial,mirrored,wrong,mixed,run] [--seeds 1,2,3,4,5]
        [--keep FOLDER] [--mesh mesh_1m.ply] [--divide 1]

A scene folder holds mesh.ply, photos/ and cameras_reference.json. Features, matches and structure
from motion are kept in FOLDER. For each seed block and mesh are put into other random frames.

| what | the block | must |
|---|---|---|
| motion | all photos, against the reference, a similarity apart | |
| all | of all photos | be found, 95 % of the photos within .3 % of the width |
| four | of four photos that overlap | be found |
| partial | on a fifth of the faces, .2 % noise, a third cut away | be found |
| mirrored | on its mesh mirrored, and on a part of that | be refused |
| wrong | on the meshes of the other scenes, and on parts of these | be refused |
| mixed | with a fifth of photos of another scene | hold none of these; found as `all` |
| run | `register` and `refine` in a project of photos and mesh, in seconds and MB of all | be |
| | within .35 px in the median and 1 px at most, a similarity taken out; 1.2 and 2 px with it | |

The last lines count: found of what must be, accepted of what must not be, and photos that are
accepted though they are more than .5 % off.
"""

from __future__ import annotations

import argparse
import pickle
import resource
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import trimesh
from bench_block_placement import HEAD, Placing, RealScene, load, partial, placed
from block_errors import best_similarity, errors_px, offsets_px, visible
from block_scenes import mirrored, moved, random_similarity

from texproj.files import file_hash
from texproj.formats.cameras import read_cameras
from texproj.formats.meshes import read_mesh
from texproj.formats.models.ply import write_ply
from texproj.formats.photos import read_photo, read_photo_info
from texproj.mesh import Mesh
from texproj.project import Project
from texproj.register.block.structure_from_motion import (
    LONGEST_PX,
    BlockPhoto,
    Motion,
    structure_from_motion,
)
from texproj.stages.bench import Workbench
from texproj.stages.refining import refine_project
from texproj.stages.registering import register_photos

WITHIN_PERCENT, WRONG_PERCENT = 0.3, 0.5
PLACED = ("all", "four", "partial", "mirrored", "wrong", "mixed")


@dataclass(frozen=True)
class Photos:
    """Files of photos, by the names under which they are known, each of one lens per folder."""

    files: dict[str, Path]

    @classmethod
    def of(cls, scene: Path, start: int = 0, count: int = 999) -> Photos:
        files = sorted((scene / "photos").iterdir())[start : start + count]
        return cls({file.name: file for file in files})

    def with_strangers(self, other: Path) -> Photos:
        """A fifth of them more, of another scene, spread over it."""
        files = sorted((other / "photos").iterdir())
        few = files[:: max(1, len(files) // max(2, round(len(self.files) / 5)))]
        few = few[: max(2, round(len(self.files) / 5))]
        return Photos(self.files | {f"stranger-{file.name}": file for file in few})

    def motion(self, keep: Path, what: str) -> Motion:
        """Structure from motion, or what was kept of it."""
        known = keep / f"{what}.pkl"
        if not known.is_file():
            known.write_bytes(pickle.dumps(self._motion(keep)))
        return pickle.loads(known.read_bytes())

    def _motion(self, keep: Path) -> Motion:
        photos = [
            BlockPhoto(replace(read_photo_info(file), name=name), file_hash(file), str(file.parent))
            for name, file in self.files.items()
        ]

        def read(name):
            return read_photo(self.files[name], read_photo_info(self.files[name]), None, LONGEST_PX)

        with tempfile.TemporaryDirectory() as scratch:
            return structure_from_motion(
                photos, read, str(keep / "features.db"), scratch, lambda *_: None
            )


def main() -> None:
    """Measure what was asked for."""
    options = parsed()
    with tempfile.TemporaryDirectory() as folder:
        keep = options.keep or Path(folder)
        keep.mkdir(exist_ok=True)
        scenes = [with_mesh(load(s, None), options) for s in options.scenes]
        seeds = [int(seed) for seed in options.seeds.split(",")]
        tally = Tally()
        print(HEAD)
        for what in options.what.split(","):
            for scene in scenes:
                for line in lines(what, scene, scenes, seeds, keep, tally):
                    print(line, flush=True)
        print("\n".join(tally.lines()))


@dataclass
class Tally:
    """What came of all placements: (right, Placing) of each."""

    placed: list[tuple[bool, Placing]] = field(default_factory=list)

    def lines(self) -> Iterator[str]:
        """What the floors ask for."""
        right = [found for is_right, found in self.placed if is_right]
        wrong = [found for is_right, found in self.placed if not is_right]
        off = np.array([e for found in right if found.accepted for e in found.errors])
        if right:
            within = np.mean(off < WITHIN_PERCENT) if len(off) else 0.0
            yield (
                f"right meshes: {sum(p.accepted for p in right)} of {len(right)} found;"
                f" {within:.1%} of {len(off)} photos within {WITHIN_PERCENT} %,"
                f" {(off > WRONG_PERCENT).sum()} more than {WRONG_PERCENT} % off"
            )
        if wrong:
            yield (
                f"wrong and mirrored meshes: {sum(p.accepted for p in wrong)} of {len(wrong)}"
                " accepted"
            )


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--what", default="motion,all,four,partial,mirrored,wrong,mixed,run")
    parser.add_argument("--seeds", default="1,2,3,4,5")
    parser.add_argument("--keep", type=Path, help="keep features and blocks here")
    parser.add_argument("--mesh", help="another mesh of the scene folders")
    parser.add_argument("--divide", type=int, default=0, help="each face into four, so often")
    return parser.parse_args()


def with_mesh(scene: RealScene, options: argparse.Namespace) -> RealScene:
    mesh = scene.mesh
    if options.mesh:
        mesh = Mesh(*read_mesh(scene.folder / options.mesh))
    for _ in range(options.divide):
        mesh = Mesh(*trimesh.remesh.subdivide(mesh.vertices, mesh.faces))
    return replace(scene, mesh=mesh)


def lines(
    what: str, scene: RealScene, scenes: Sequence[RealScene], seeds: Sequence[int], keep: Path,
    tally: Tally,
) -> Iterator[str]:  # fmt: skip
    """The lines of a table about one scene."""
    others = [other for other in scenes if other is not scene]
    if what == "motion":
        yield motion_line(scene, keep)
    if what == "run":
        yield from (run_line(scene, seed) for seed in seeds)
    if what not in PLACED or (what in ("wrong", "mixed") and not others):
        return
    block, note = blocked(what, scene, others, keep)
    for seed in seeds:
        for label, mesh in meshes(what, scene, others, seed):
            right = what not in ("mirrored", "wrong")
            found = placed(block, mesh, seed, right)
            tally.placed.append((right, found))
            told = judged(what, found)
            yield found.line(f"{scene.folder.name[:13]} {label}", seed) + f" | {told}{note}"


def blocked(
    what: str, scene: RealScene, others: Sequence[RealScene], keep: Path
) -> tuple[RealScene, str]:
    """The scene with the block that is placed, and what to note of it."""
    name = scene.folder.name
    photos = Photos.of(scene.folder)
    if what == "four":
        motion = Photos.of(scene.folder, len(photos.files) // 2 - 2, 4).motion(keep, f"{name}-four")
        return replace(scene, block=motion.parts[0]), f", {len(motion.parts[0].names)} of 4"
    if what == "mixed":
        motion = photos.with_strangers(others[0].folder).motion(keep, f"{name}-mixed")
        held = [n for n in motion.parts[0].names if n.startswith("stranger")]
        note = f", strangers in the block: {held or 'none'}"
        return replace(scene, block=motion.parts[0]), note
    motion = photos.motion(keep, name)
    return replace(scene, block=motion.parts[0]), ""


def meshes(
    what: str, scene: RealScene, others: Sequence[RealScene], seed: int
) -> list[tuple[str, Mesh]]:
    if what == "partial":
        return [("partial", partial(scene.mesh, seed))]
    if what == "mirrored":
        whole = mirrored(scene.mesh)
        return [("mirrored", whole), ("mirrored, part", partial(whole, seed))]
    if what == "wrong":
        whole = [(f"on {other.folder.name[:8]}", other.mesh) for other in others]
        return [*whole, *((f"{name}, part", partial(mesh, seed)) for name, mesh in whole)]
    return [(what, scene.mesh)]


def judged(what: str, found: Placing) -> str:
    """Whether the floor is met."""
    if what in ("mirrored", "wrong"):
        return "WRONG" if found.accepted else "met"
    within = np.mean(np.array(found.errors or (np.inf,)) < WITHIN_PERCENT)
    wrong = found.accepted and max(found.errors) > WRONG_PERCENT
    enough = within >= 0.95 or what in ("four", "partial")
    return "WRONG" if wrong else "met" if found.accepted and enough else "not met"


def motion_line(scene: RealScene, keep: Path) -> str:
    """Structure from motion alone, a similarity taken out."""
    start = time.perf_counter()
    found = Photos.of(scene.folder).motion(keep, scene.folder.name)
    spent = time.perf_counter() - start
    child = resource.getrusage(resource.RUSAGE_CHILDREN)
    part = found.parts[0]
    off = errors_px(part, scene.cameras, scene.mesh.vertices)
    k, true = part.cameras[0].intrinsics, scene.cameras[part.names[0]].intrinsics
    return (
        f"{scene.folder.name}: {len(part.names)} of {len(scene.cameras)} placed,"
        f" {len(part.points)} points, {part.error_px.mean():.2f} px;"
        f" cameras {np.median(off):.2f} / {off.max():.2f} px;"
        f" focal {100 * (k.fx / true.fx - 1):+.2f} %, principal point"
        f" {k.cx - true.cx:+.0f} {k.cy - true.cy:+.0f} px; {spent:.0f} s,"
        f" {child.ru_utime:.0f} s of processor time, {child.ru_maxrss / 1024:.0f} MB"
    )


def run_line(scene: RealScene, seed: int) -> str:
    """A project of photos and a mesh, registered and refined."""
    world_from_scene = random_similarity(np.random.default_rng(seed))
    with tempfile.TemporaryDirectory() as root:
        project = made(Path(root), scene, moved(scene.mesh, world_from_scene))
        begun = seconds()
        with Workbench(project) as bench:
            outcomes = register_photos(bench)
            refine_project(bench)
        spent = seconds() - begun
        records = {r.file: r for r in read_cameras(project.cameras_path).records}
    found = {name: r.registered_camera for name, r in records.items() if r.registered_camera}
    true = [world_from_scene.camera(scene.cameras[name]) for name in found]
    xyz = world_from_scene.apply(scene.mesh.vertices)
    seen = [visible(camera, xyz) for camera in true]
    apart = off_px(list(found.values()), true, seen)
    common = best_similarity(list(found.values()), true, seen)
    left = off_px([common.camera(camera) for camera in found.values()], true, seen)
    peak = max(resource.getrusage(who).ru_maxrss for who in (0, resource.RUSAGE_CHILDREN)) / 1024
    met = np.median(left) <= 0.35 and max(left) <= 1 and np.median(apart) <= 1.2 and max(apart) <= 2
    return (
        f"{scene.folder.name[:13]} run, seed {seed}: {len(found)} of {len(outcomes)} registered;"
        f" {np.median(apart):.2f} / {max(apart):.2f} px, a similarity taken out"
        f" {np.median(left):.2f} / {max(left):.2f} px; {spent:.0f} s of processor time,"
        f" {peak:.0f} MB | {'met' if met else 'not met'}"
    )


def made(root: Path, scene: RealScene, mesh: Mesh) -> Project:
    for name in ("mesh", "photos"):
        (root / name).mkdir()
    write_ply(root / "mesh" / "scan.ply", mesh.vertices, mesh.faces, None)
    for name in scene.cameras:
        shutil.copy(scene.folder / "photos" / name, root / "photos" / name)
    return Project.open(root)


def off_px(found, true, seen) -> list[float]:
    """Median distance in each photo between the images of what it sees, full-size pixels."""
    sets = zip(found, true, seen, strict=True)
    return [float(np.median(offsets_px(a, b, xyz))) for a, b, xyz in sets]


def seconds() -> float:
    """Of processor time, of this process and those that it started and that ended."""
    used = [resource.getrusage(who) for who in (0, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


if __name__ == "__main__":
    main()
