"""Memory and time of coloring with photos of 45 megapixels, as their number grows.

    python tests/bench_large_photos.py ../shared/data/fountain-P11 [--mp 45] [--photos 2,4,8]
        [--kinds jpg,dng] [--keep DIR]

The scene's photos are enlarged (repeated under other names where there are not enough), as JPEG or
as RAW files with a Bayer pattern, with their reference cameras. Prints for each number of photos
seconds, processor seconds and peak memory of `texproj color` as a process of its own, and what
each photo more costs.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import cv2
import numpy as np
from color_runs import color, make_project
from raw_files import write_dng

from texproj.photo import LINEAR_OF_SRGB8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--mp", type=float, default=45)
    parser.add_argument("--photos", default="2,4,8")
    parser.add_argument("--kinds", default="jpg,dng")
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    counts = sorted(map(int, given.photos.split(",")))
    with tempfile.TemporaryDirectory() as temporary:
        for kind in given.kinds.split(","):
            print(f"{kind}: photos, seconds, of processors, MB")
            peaks = []
            for count in counts:
                folder = (given.keep or Path(temporary)) / f"{kind}-{count}"
                enlarged(given.scene, folder, count, given.mp, kind)
                run = color(folder, "texture")
                print(f"{count:5} {run} {run.failure}", flush=True)
                peaks.append(run.megabytes)
            if len(counts) > 1:
                slope = np.polyfit(counts, peaks, 1)[0]
                print(f"each photo more: {slope:.1f} MB")


def enlarged(scene: Path, folder: Path, count: int, mp: float, kind: str) -> None:
    """A project of `count` photos of so many megapixels."""
    make_project(scene, folder, every=True, times=-(-count // 11))
    (folder / "project.toml").write_text("[color]\noccluders = false\n")
    cameras = json.loads((folder / "cameras.json").read_text())
    chosen = cameras["photos"][:count]
    for entry in cameras["photos"][count:]:
        (folder / "photos" / entry["file"]).unlink()
    for entry in chosen:
        path = folder / "photos" / entry["file"]
        picture = cv2.imread(str(path))
        scale = np.sqrt(mp * 1e6 / (entry["width"] * entry["height"]))
        size = [2 * round(side * scale / 2) for side in (entry["width"], entry["height"])]
        large = cv2.resize(picture, size, interpolation=cv2.INTER_CUBIC)
        path.unlink()
        made = path.with_suffix(f".{kind}")
        if kind == "dng":
            write_dng(made, LINEAR_OF_SRGB8[large[..., ::-1]])
        else:
            cv2.imwrite(str(made), large)
        K = np.array(entry["K"]) * [[size[0] / entry["width"]], [size[1] / entry["height"]], [1]]
        entry |= {"file": made.name, "width": size[0], "height": size[1], "K": K.tolist()}
    (folder / "cameras.json").write_text(json.dumps({**cameras, "photos": chosen}))


if __name__ == "__main__":
    main()
