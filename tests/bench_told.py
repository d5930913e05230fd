"""Is the expected error true? What `register` and `refine` tell beside what is true, set by set.

    python tests/bench_told.py [SCENE_FOLDER ...] [--what picks,structure,block,features,...]
        [--refine]

Without what is asked for, all sets. Of each scene folder (mesh.ply, photos/, correspondences/,
cameras_reference.json, cameras_start_120px.json) photos are registered from their picks, with
calibrated lenses and without; by structure from starts that are 120 px off; as a block without any
start; by features through every second photo, which has picks. Then projects/stele, the demo's
shrine, a painted vase with picks in one photo, a patterned cushion from rough cameras. Each is a
project of its own.

Columns: photos registered; true error, mean distance of the surface in a photo, percent of the
longer side, median over photos; told: the same as expected; true / told, median and the 10th and
90th percentile over photos. --refine: the same after `refine`, of the whole, and with the best
common similarity taken out against the agreement that is told.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from block_errors import best_similarity, offsets_px
from painted_scenes import cushion_scene, prior, vase_scene

from texproj.camera import Camera
from texproj.demo.views import disturbed
from texproj.demo.write import write_demo
from texproj.formats.cameras import cameras_json, read_cameras
from texproj.mesh import vertex_normals
from texproj.options import DemoOptions
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.bench import Workbench
from texproj.stages.refining import refine_project
from texproj.stages.registering import register_photos

STELE = Path(__file__).parents[1] / "projects" / "stele"
HEAD = f"{'set':>26} {'method':>10} {'photos':>6} {'true %':>7} {'told %':>7} {'true/told':>18}"


@dataclass(frozen=True, eq=False)
class Case:
    """A project and its true cameras by name."""

    project: Project
    truth: Mapping[str, Camera]


@dataclass(frozen=True, eq=False)
class Error:
    """Of one photo: how it was found, how far off it is and what is told, percent."""

    method: str
    true: float
    told: float


def seen_by(camera: Camera, xyz: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Some of the points that face a camera inside its picture."""
    xy, depth = camera.project(xyz)
    toward = ((camera.center - xyz) * normals).sum(axis=1) > 0
    seen = np.flatnonzero(camera.inside(xy) & (depth > 0) & toward)
    return xyz[seen[:: max(1, len(seen) // 1000)]]


def errors(case: Case) -> list[Error]:
    """Of all registered photos."""
    mesh, found = case.project.load_mesh().mesh, case.project.load_cameras()
    normals = vertex_normals(mesh)
    out = []
    for name, true in case.truth.items():
        record = found.get(name)
        if record is None or record.registered_camera is None:
            continue
        xyz = seen_by(true, mesh.vertices, normals)
        side = max(true.width, true.height)
        off = 100 * offsets_px(record.registered_camera, true, xyz).mean() / side
        told = 100 * float(record.quality.get("expected_error_px", np.nan)) / side
        out.append(Error(record.method or "-", float(off), told))
    return out


def line(label: str, method: str, some: Sequence[Error]) -> str:
    ratio = np.array([e.true / e.told for e in some])
    low, middle, high = np.percentile(ratio, (10, 50, 90))
    return (
        f"{label:>26} {method:>10} {len(some):6d} {np.median([e.true for e in some]):7.3f} "
        f"{np.median([e.told for e in some]):7.3f} {middle:6.2f} ({low:.2f} {high:.2f})"
    )


def lines(label: str, case: Case, refined: bool) -> Iterator[str]:
    """What `register` tells of a project, by method, and what `refine` tells."""
    with Workbench(case.project) as bench:
        register_photos(bench)
        found = errors(case)
        for method in sorted({e.method for e in found}):
            yield line(label, method, [e for e in found if e.method == method])
        if not found:
            yield f"{label:>26} nothing registered"
        if refined and len(found) > 1:
            quality = refine_project(bench).quality
            yield line(label, "refined", errors(case))
            yield agreement_line(label, case, quality)


def agreement_line(label: str, case: Case, quality: Mapping) -> str:
    """With one similarity common to all taken out, in pixels."""
    mesh, found = case.project.load_mesh().mesh, case.project.load_cameras()
    normals = vertex_normals(mesh)
    names = [n for n in case.truth if n in found and found[n].registered_camera is not None]
    mine, true = [found[n].registered_camera for n in names], [case.truth[n] for n in names]
    seen = [seen_by(camera, mesh.vertices, normals)[::4] for camera in true]
    common = best_similarity(mine, true, seen)
    left = [
        float(offsets_px(common.camera(a), b, xyz).mean())
        for a, b, xyz in zip(mine, true, seen, strict=True)
    ]
    told, ties = (quality["agreement"][k] for k in ("expected_px", "tie_residual_working_px"))
    return (
        f"{label:>26} {'agreement':>10} {len(names):6d}  true {np.median(left):.3f} px, told "
        f"{told:.3f} px, true / told {np.median(left) / told:.2f}; ties {ties:.3f} working px"
    )


# --- real scenes


def of_scene(scene: Path, root: Path) -> Case:
    """A project of a scene's mesh and photos alone."""
    for name in ("mesh", "photos"):
        (root / name).mkdir(parents=True)
    shutil.copy(scene / "mesh.ply", root / "mesh" / "scan.ply")
    for photo in (scene / "photos").iterdir():
        shutil.copy(photo, root / "photos" / photo.name)
    records = read_cameras(scene / "cameras_reference.json").records
    return Case(Project.open(root), {r.file: r.camera for r in records if r.camera})


def with_lenses(case: Case) -> Case:
    """The lenses are given, no poses."""
    lenses = [
        CameraRecord(name, c.width, c.height, c.intrinsics, None, "prior")
        for name, c in case.truth.items()
    ]
    (case.project.root / "cameras.json").write_text(cameras_json(lenses))
    return replace(case, project=Project.open(case.project.root))


def with_picks(scene: Path, case: Case, names: Sequence[str] | None = None) -> Case:
    """Picks of these photos, by default all."""
    folder = case.project.root / "correspondences"
    folder.mkdir()
    for path in (scene / "correspondences").iterdir():
        if names is None or path.stem in names:
            shutil.copy(path, folder / path.name)
    return case


def picks(scene: Path, root: Path) -> Case:
    return with_lenses(with_picks(scene, of_scene(scene, root)))


def picks_no_lens(scene: Path, root: Path) -> Case:
    return with_picks(scene, of_scene(scene, root))


def structure(scene: Path, root: Path) -> Case:
    case = of_scene(scene, root)
    shutil.copy(scene / "cameras_start_120px.json", root / "cameras.json")
    return replace(case, project=Project.open(root))


def features(scene: Path, root: Path) -> Case:
    case = with_lenses(of_scene(scene, root))
    return with_picks(scene, case, sorted(Path(name).stem for name in case.truth)[::2])


SCENES: dict[str, Callable[[Path, Path], Case]] = {
    "picks": picks,
    "picks_no_lens": picks_no_lens,
    "structure": structure,
    "block": of_scene,
    "features": features,
}


# --- synthetic sets


def stele(root: Path) -> Case:
    shutil.copytree(STELE, root)
    shutil.rmtree(root / "work", ignore_errors=True)
    return Case(Project.open(root), true_cameras(root / "truth/cameras.json"))


def demo(root: Path) -> Case:
    root.mkdir()
    write_demo(root, DemoOptions())
    return Case(Project.open(root), true_cameras(root / "truth/cameras.json"))


def vase(root: Path) -> Case:
    scene = vase_scene()
    return Case(
        scene.written(root, picks={"IMG_0005.jpg": scene.picks("IMG_0005.jpg")}), scene.cameras
    )


def cushion(root: Path) -> Case:
    scene = cushion_scene()
    points = scene.scan.vertices[::37]
    rough = [
        prior(name, disturbed(camera, points, 15, np.random.default_rng([7, k])))
        for k, (name, camera) in enumerate(scene.cameras.items())
    ]
    return Case(scene.written(root, starts=rough), scene.cameras)


def true_cameras(path: Path) -> dict[str, Camera]:
    return {r.file: r.camera for r in read_cameras(path).records if r.camera}


SYNTHETIC: dict[str, Callable[[Path], Case]] = {
    "stele": stele,
    "demo": demo,
    "vase": vase,
    "cushion": cushion,
}


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--what", default=",".join([*SCENES, *SYNTHETIC]))
    parser.add_argument("--refine", action="store_true")
    options = parser.parse_args()
    print(HEAD)
    for what in options.what.split(","):
        made = (
            [(f"{s.name} {what}", s) for s in options.scenes] if what in SCENES else [(what, None)]
        )
        for label, scene in made:
            begun = time.process_time()
            with tempfile.TemporaryDirectory() as folder:
                root = Path(folder) / "p"
                case = SCENES[what](scene, root) if scene else SYNTHETIC[what](root)
                for told in lines(label, case, options.refine):
                    print(told, flush=True)
            print(f"{'':>26} {time.process_time() - begun:.0f} s", flush=True)


if __name__ == "__main__":
    main()
