"""How well light is told from paint: photographs by Mitsuba, and real ones.

    pip install mitsuba
    python tests/bench_appearance.py                       # synthetic: about 10 minutes
    python tests/bench_appearance.py --photos 20 --samples 48
    python tests/bench_appearance.py --real PROJECT ...    # real photos, registered

Of synthetic sets it prints CIEDE2000 of the base color, median and 90 %, against the true albedo
as a pixel averages it, over points that at least 3 photos see: at the best common scale, and with
the tint known (the best scale per channel); cavities see less than 70 % of the sky. Of real ones
it prints the verdict, and the suns that each half of the photos tells.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from appearance_scenes import Set, natural_set
from photo_sets import photo_set as photos_of
from skimage.color import deltaE_ciede2000

from texproj.appearance.natural import natural_appearance
from texproj.appearance.sun import angle_deg
from texproj.color.checker.fit import lab_of_srgb
from texproj.color.result import VertexColors
from texproj.color.sampling.photo_set import PhotoSet
from texproj.color.vertices import color_vertices
from texproj.mesh import Mesh
from texproj.options import ColorOptions, RenderOptions
from texproj.photo import LUMINANCE, Photo, PhotoInfo
from texproj.project import Project
from texproj.render import ambient_occlusion, open_renderer
from texproj.stages.coloring import photo_set, usable_cameras

SCALES = np.exp(np.linspace(-1.5, 1.5, 61))
CAVITY = 0.7


def blended(mesh: Mesh, photos: PhotoSet) -> VertexColors:
    """What the stage works on."""
    with open_renderer(RenderOptions()) as renderer:
        return color_vertices(mesh, photos, renderer, ColorOptions(to="vertices", highlight=1))


def off(found, truth, tint_known):
    """(n,) CIEDE2000 at the best scale."""
    tint = np.ones(3)
    if tint_known:
        tint = np.median(truth / np.maximum(found, 1e-3), axis=0)
        tint = tint / (tint @ LUMINANCE)
    lab = lab_of_srgb(truth)
    tried = [deltaE_ciede2000(lab_of_srgb(np.clip(found * tint * s, 0, 1)), lab) for s in SCALES]
    return min(tried, key=np.median)


def synthetic(kind: str, weather: str, photos: int, samples: int, gold: bool) -> None:
    """One line of the table for the blend and one for the base color."""
    made: Set = natural_set(kind, weather, photos, samples, gold)
    cameras = list(made.cameras.values())
    shots = [Photo(PhotoInfo(n, *x.shape[1::-1]), x) for n, x in made.photos.items()]
    colors = blended(made.mesh, photos_of(cameras, shots))
    start = time.process_time()
    found = natural_appearance(made.mesh, colors.rgb, colors.weight > 0)
    seconds = time.process_time() - start
    seen = colors.photo_count >= 3
    cavity = ambient_occlusion(made.mesh)[seen] < CAVITY
    sure = found.confidence[seen] >= np.median(found.confidence[seen])
    print(f"\n{kind}, {weather}: {found.reason or 'accepted'} {found.verdict}")
    light = found.light
    if light is not None and light.to_sun is not None:
        print(f"sun {angle_deg(light.to_sun, made.light.to_sun):.2f} degrees off")
    else:
        print("no sun")
    print(f"{seconds:.1f} s of CPU for {len(seen)} points")
    for name, rgb in (("blend", colors.rgb), ("base", found.base)):
        one = off(rgb[seen], made.albedo[seen], False)
        tint = off(rgb[seen], made.albedo[seen], True)
        p90 = [np.percentile(x, 90) for x in (one, tint)]
        print(
            f"{name:6} one scale {np.median(one):5.2f} / {p90[0]:5.2f}   tint known"
            f" {np.median(tint):5.2f} / {p90[1]:5.2f}   cavities {np.median(tint[cavity]):5.2f}"
            f"   surer half {np.median(tint[sure]):5.2f}"
        )


def real(root: Path) -> None:
    """The verdict on a project, and the suns of the two halves of its photos."""
    project = Project.open(root)
    mesh = project.load_mesh().mesh
    cameras, _ = usable_cameras(project)
    names = list(cameras)
    print(f"\n{root.name}")
    for label, part in (("all", names), ("even", names[::2]), ("odd", names[1::2])):
        colors = blended(mesh, photo_set(project, {n: cameras[n] for n in part}))
        found = natural_appearance(mesh, colors.rgb, colors.weight > 0)
        sun = None if found.light is None else found.light.to_sun
        told = "no sun" if sun is None else f"sun {np.round(sun, 3)}"
        print(f"{label:5} {told}; {found.reason or 'accepted'} {found.verdict}")


def main() -> None:
    """All that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photos", type=int, default=12)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--gold", action="store_true", help="metal, which it is not made for")
    parser.add_argument("--real", type=Path, nargs="*", default=[])
    asked = parser.parse_args()
    for root in asked.real:
        real(root)
    if not asked.real:
        for kind in ("stele", "capital"):
            for weather in ("sun", "cloudy"):
                synthetic(kind, weather, asked.photos, asked.samples, asked.gold)


if __name__ == "__main__":
    main()
