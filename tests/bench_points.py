"""Registration by picks on real photographs, against their reference cameras.

    python tests/bench_points.py [DATA]

DATA: folder with fountain-P11 and sceaux-castle, by default ../shared/data beside the checkout or
TEXPROJ_DATA. Prints one row per scene and case; errors are mean distances, over mesh vertices
that face the reference camera inside the picture, between their images in both cameras, pixels.
"""

import os
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh

from texproj.camera import Camera
from texproj.errors import RegistrationError
from texproj.formats.cameras import read_cameras
from texproj.formats.correspondences import read_correspondences
from texproj.options import PointsOptions
from texproj.photo import PhotoInfo
from texproj.register.picks.register import register_points

CHECKOUT = Path(__file__).resolve().parent.parent
SCENES = ("fountain-P11", "sceaux-castle")
CASES = {
    "focal known": ("correspondences", 1.0, "prior"),
    "focal known, outliers": ("correspondences_bad", 1.0, "prior"),
    "focal given 20 % long": ("correspondences", 1.2, "prior"),
    "focal given 20 % short": ("correspondences", 1 / 1.2, "prior"),
    "focal 20 % long, outliers": ("correspondences_bad", 1.2, "prior"),
    "declared unknown, 20 % long": ("correspondences", 1.2, "unknown"),
    "EXIF focal 3 % long": ("correspondences", 1.03, "exif"),
    "nothing known": ("correspondences", 1.0, "nothing"),
    "nothing known, outliers": ("correspondences_bad", 1.0, "nothing"),
}
HEADER = f"{'scene':14s} {'case':27s} median    max  expected/true  focal %  outliers told  s"


@dataclass(frozen=True, eq=False)
class Scene:
    """A folder of real photographs with reference cameras, picks and a mesh."""

    folder: Path
    cameras: dict[str, Camera]
    vertices: np.ndarray
    normals: np.ndarray

    @classmethod
    def read(cls, folder):
        found = read_cameras(folder / "cameras_reference.json").records
        cameras = {Path(record.file).stem: record.camera for record in found}
        mesh = trimesh.load(folder / "mesh.ply", process=False)
        few = np.random.default_rng(0).choice(len(mesh.vertices), 20000, replace=False)
        normals = np.asarray(mesh.vertex_normals)[few]
        return cls(folder, cameras, np.asarray(mesh.vertices)[few], normals)

    def error_px(self, found, reference):
        xy = reference.project(self.vertices)[0]
        facing = ((reference.center - self.vertices) * self.normals).sum(axis=1) > 0
        seen = reference.inside(xy) & facing
        moved = found.project(self.vertices[seen])[0] - xy[seen]
        return float(np.linalg.norm(moved, axis=1).mean())

    def spoiled(self, stem):
        """Names of the picks that correspondences_bad has changed."""
        clean, bad = (
            read_correspondences(self.folder / kind / f"{stem}.csv")
            for kind in ("correspondences", "correspondences_bad")
        )
        moved = (clean.xy_px != bad.xy_px).any(axis=1)
        moved |= (clean.xyz_in_world != bad.xyz_in_world).any(axis=1)
        return [name for name, m in zip(bad.names, moved, strict=True) if m]


def attempt(scene, stem, case):
    """(error, expected error, relative error of the focal length, outliers as they are)."""
    kind, factor, given = CASES[case]
    reference = scene.cameras[stem]
    k = reference.intrinsics
    prior = replace(k, fx=k.fx * factor, fy=k.fy * factor)
    info = PhotoInfo(f"{stem}.jpg", k.width, k.height)
    if given == "exif":
        info = replace(info, focal_px=prior.fx)
    picks = read_correspondences(scene.folder / kind / f"{stem}.csv")
    options = PointsOptions(focal="unknown" if given == "unknown" else "auto")
    lens = prior if given in ("prior", "unknown") else None
    try:
        fit = register_points(info, picks, lens, options, surface=scene.vertices)
    except RegistrationError as error:
        print(error)
        return np.inf, 1.0, np.inf, 0.0
    told = fit.quality["outliers"] == (scene.spoiled(stem) if kind.endswith("bad") else [])
    error = scene.error_px(fit.camera, reference)
    return error, fit.expected_error_px, abs(fit.camera.intrinsics.fx / k.fx - 1), float(told)


def row(scene, case):
    start = time.process_time()
    table = np.array([attempt(scene, stem, case) for stem in sorted(scene.cameras)])
    seconds = (time.process_time() - start) / len(table)
    error, expected, focal, told = table.T
    ratio = np.sqrt((expected**2).mean() / (error**2).mean())
    return (
        f"{scene.folder.name:14s} {case:27s} {np.median(error):6.2f} {error.max():6.2f} "
        f"{ratio:10.2f} {100 * focal.max():11.2f} {int(told.sum()):6d}/{len(told)} {seconds:6.2f}"
    )


def main():
    default = os.environ.get("TEXPROJ_DATA") or CHECKOUT / "../shared/data"
    data = Path(sys.argv[1] if len(sys.argv) > 1 else default)
    print(HEADER)
    for name in SCENES:
        scene = Scene.read(data / name)
        for case in CASES:
            print(row(scene, case), flush=True)


if __name__ == "__main__":
    main()
