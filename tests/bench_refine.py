"""Joint refinement on real scenes: how exact the cameras are before and after.

python tests/bench_refine.py SCENE_FOLDER ... [--start 120] [--seed 1] [--foreign]

A scene folder holds mesh.ply, photos/ and cameras_reference.json. Each photo is registered by
structure from a disturbed reference camera, then all together. --foreign mirrors the last photo
but keeps its camera: it must be thrown out, and the others must end where they end without it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from bench_registration import disturbed, load, mirrored, photo

from texproj.camera import Camera
from texproj.photo import Photo
from texproj.register.joint.lenses import PhotoStart
from texproj.register.joint.refine import Refined, refine
from texproj.register.structure.register import register_structure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--start", default="120")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--foreign", action="store_true")
    arguments = parser.parse_args()
    for folder in arguments.scenes:
        measure(folder, arguments.start, arguments.seed, arguments.foreign)


def measure(folder: Path, start: str, seed: int, foreign: bool) -> None:
    """Print the table of one scene."""
    scene = load(folder, 1)
    names = list(scene.cameras)
    rng = np.random.default_rng(seed)
    fits = [
        register_structure(
            scene.photos[n], disturbed(scene.cameras[n], scene.points, start, rng), scene.render
        )
        for n in names
    ]
    before = [fit.camera for fit in fits]
    sigma = [fit.expected_error_px for fit in fits]
    begin = time.process_time()
    found = joined(scene, folder, before, sigma, ())
    seconds = (time.process_time() - begin) / len(names)
    print(f"\n{scene.name}: {len(names)} photos, {seconds:.1f} s of processor time a photo")
    show("alone", scene, names, before)
    show("together", scene, names, found.cameras)
    if foreign:
        other = joined(scene, folder, before, sigma, (names[-1],))
        pairs = list(zip(found.cameras, other.cameras, strict=True))[:-1]
        apart = [scene.error_px(a, b) for a, b in pairs]
        print(f"mirrored photo thrown out: {len(names) - 1 in other.thrown_out}, "
              f"the others moved by at most {max(apart):.2f} px")  # fmt: skip


def joined(
    scene, folder: Path, cameras: Sequence[Camera], sigma: Sequence[float], turned: Sequence[str]
) -> Refined:
    """The refinement; the photos named in `turned` are mirrored."""
    names = list(scene.cameras)

    def read(number: int, longest: int) -> Photo:
        picture = photo(folder / "photos" / names[number], longest)
        return mirrored(picture) if names[number] in turned else picture

    starts = [PhotoStart(c, px, given=True) for c, px in zip(cameras, sigma, strict=True)]
    return refine(starts, read, scene.render)


def show(label: str, scene, names: Sequence[str], cameras: Sequence[Camera]) -> None:
    pairs = zip(names, cameras, strict=True)
    errors = [scene.error_px(camera, scene.cameras[name]) for name, camera in pairs]
    print(f"{label:>10}: median {np.median(errors):.2f} px, max {max(errors):.2f} px")


if __name__ == "__main__":
    main()
