"""Structure from motion of the photos alone, on real scenes, against their reference cameras.

    python tests/bench_block.py ../shared/data/fountain-P11 ../shared/data/sceaux-castle

Prints for each scene: photos placed, points, their mean error (pixels of the reduced photos), the
cameras' error after one similarity common to all (median image motion of the mesh's vertices,
full-size pixels, median and largest photo), focal length against the reference, seconds, and
megabytes of the process that runs COLMAP.
"""

from __future__ import annotations

import argparse
import pickle
import resource
import tempfile
import time
from pathlib import Path

import numpy as np
from block_errors import errors_px

from texproj.formats.cameras import read_cameras
from texproj.formats.meshes import read_mesh
from texproj.formats.photos import read_photo, read_photo_info
from texproj.register.block.structure_from_motion import (
    LONGEST_PX,
    BlockPhoto,
    structure_from_motion,
)


def measure(scene: Path, keep: Path | None, every: int) -> str:
    """One line of the table."""
    infos = [read_photo_info(p) for p in sorted((scene / "photos").iterdir())][::every]
    photos = [BlockPhoto(info, f"k{n}", "lens") for n, info in enumerate(infos)]

    def load(name):
        path = scene / "photos" / name
        return read_photo(path, read_photo_info(path), longest=LONGEST_PX)

    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder) / "scratch"
        scratch.mkdir()
        found = structure_from_motion(
            photos, load, str(Path(folder) / "features.db"), str(scratch), lambda *_: None
        )
    spent = time.perf_counter() - start
    child = resource.getrusage(resource.RUSAGE_CHILDREN)
    part = found.parts[0]
    if keep:
        with keep.open("wb") as file:
            pickle.dump(part, file)
    records = read_cameras(scene / "cameras_reference.json").records
    reference = {r.file: r.camera for r in records}
    off = errors_px(part, reference, read_mesh(scene / "mesh.ply")[0])
    k, true = part.cameras[0].intrinsics, reference[part.names[0]].intrinsics
    return (
        f"{scene.name}: {len(part.names)} of {len(photos)} placed, {len(part.points)} points,"
        f" {part.error_px.mean():.2f} px; cameras {np.median(off):.2f} / {off.max():.2f} px;"
        f" focal {100 * (k.fx / true.fx - 1):+.2f} %, principal point"
        f" {k.cx - true.cx:+.0f} {k.cy - true.cy:+.0f} px; {spent:.0f} s,"
        f" {child.ru_utime:.0f} s of processor time, {child.ru_maxrss / 1024:.0f} MB"
    )


def main() -> None:
    """Measure the scenes that were named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--keep", type=Path, help="pickle the largest part here")
    parser.add_argument("--every", type=int, default=1, help="use every n-th photo")
    options = parser.parse_args()
    for scene in options.scenes:
        print(measure(scene, options.keep, options.every), flush=True)


if __name__ == "__main__":
    main()
