"""How well light is told from paint: photographs by Mitsuba, and real ones.

    pip install mitsuba
    python tests/bench_appearance.py                       # natural light: about 12 minutes
    python tests/bench_appearance.py --what turntable      # about 12 minutes
    python tests/bench_appearance.py --photos 20 --only capital     # the same of more photos
    python tests/bench_appearance.py --width 960                    # ... of larger ones
    python tests/bench_appearance.py --gold                # metal, which must not come out worse
    python tests/bench_appearance.py --real PROJECT ...    # real photos, registered

Of synthetic sets it prints CIEDE2000 of the base color, median and 90 %, against the true albedo
around each vertex, over points that at least 3 photos see: at the best common scale, and with the
tint known (the best scale per channel); cavities see less than 70 % of the sky. "around" is a blur
of 1.7 (FWHM) vertices' spacings of the pattern, finer than it was photographed; "own" is the
surface that was photographed, averaged over what the vertex stands for. "true light" is
what the blend gives on the same mesh when the light is not found but known: what is left then is
the mesh's and the photos'. "paint alone" is what photos of the paint in no light at all, of the
same cameras, give on that mesh: what is left then is sampling. Relit: the piece by a lamp, drawn by
Mitsuba with these colors on the scan, against the true one. Of real photos it prints the verdict,
and the suns that each half of them tells.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from appearance_scenes import SIZE, Kind, Set, natural_set, sky_image, turntable_set
from bench_flash import psnr
from flash_scenes import DarkRoom, Pair, Shot, Truth
from photo_sets import photo_set as photos_of
from skimage.color import deltaE_ciede2000

from texproj.appearance.natural import base_color, natural_appearance
from texproj.appearance.recovered import Appearance
from texproj.appearance.sun import angle_deg
from texproj.appearance.transfer import LightCaster
from texproj.appearance.turntable.turned import Blended, turntable_appearance
from texproj.color.checker.fit import lab_of_srgb
from texproj.color.result import VertexColors
from texproj.color.sampling.photo_set import PhotoSet
from texproj.color.vertices import color_vertices
from texproj.mesh import Mesh
from texproj.options import ColorOptions, RenderOptions
from texproj.photo import LUMINANCE, Photo, PhotoInfo, srgb_from_linear
from texproj.project import Project
from texproj.render import ambient_occlusion, open_renderer
from texproj.render.directions import cosine_directions
from texproj.render.rays import RayCaster
from texproj.stages.coloring import photo_set, usable_cameras

LAMPS = ((0.5, 0.6), (-0.9, 0.2))
"""Azimuth from the camera's and elevation, radians, of lamps that relight the piece."""

SEEDS: dict[Kind, int] = {"stele": 3, "capital": 3, "knot": 11}
"""Of what is carved and painted: no constant but that of gloss was looked at on the knot."""

SCALES = np.exp(np.linspace(-1.5, 1.5, 61))
CAVITY = 0.7


def blended(mesh: Mesh, photos: PhotoSet) -> VertexColors:
    """What the stage works on."""
    with open_renderer(RenderOptions()) as renderer:
        options = ColorOptions(to="vertices", highlight=1, occluders=False)
        return color_vertices(mesh, photos, renderer, options)


def off(found, truth, tint_known):
    """(n,) CIEDE2000 at the best scale."""
    tint = np.ones(3)
    if tint_known:
        tint = np.median(truth / np.maximum(found, 1e-3), axis=0)
        tint = tint / (tint @ LUMINANCE)
    lab = lab_of_srgb(truth)
    tried = [deltaE_ciede2000(lab_of_srgb(np.clip(found * tint * s, 0, 1)), lab) for s in SCALES]
    return min(tried, key=np.median)


def told(name: str, made: Set, rgb, seen, cavity, sure) -> None:
    """One line of the table."""
    for what, truth in (("around", made.albedo), ("own", made.own)):
        one, tint = (off(rgb[seen], truth[seen], known) for known in (False, True))
        p90 = [np.percentile(x, 90) for x in (one, tint)]
        print(
            f"{name:11} {what:6} one scale {np.median(one):5.2f} / {p90[0]:5.2f}   tint known"
            f" {np.median(tint):5.2f} / {p90[1]:5.2f}   cavities {np.median(tint[cavity]):5.2f}"
            f"   surer half {np.median(tint[sure]):5.2f}"
        )


def paint_alone(made: Set):
    """(V, 3) the blend of photos that show the true paint itself, four rays a pixel."""
    caster = RayCaster(made.true.vertices.astype(np.float32), made.true.faces)
    shots = []
    for name, camera in made.cameras.items():
        total = np.zeros((camera.height, camera.width, 3), np.float32)
        for dx, dy in ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)):
            x, y = np.meshgrid(np.arange(camera.width) + dx, np.arange(camera.height) + dy)
            rays = camera.rays(np.stack([x.ravel(), y.ravel()], axis=1))
            hits = caster.first(*(part.astype(np.float32) for part in rays))
            met = np.flatnonzero(hits.face >= 0)
            u, v = hits.u[met], hits.v[met]
            weights = np.stack([1 - u - v, u, v], axis=1)
            corner = made.true.faces[hits.face[met]]
            shown = np.einsum("nk,nkc->nc", weights, made.paint[corner])
            total.reshape(-1, 3)[met] += shown / 4
        pixels = np.round(srgb_from_linear(total.clip(0, 1)) * 255).astype(np.uint8)
        shots.append(Photo(PhotoInfo(name, camera.width, camera.height), pixels))
    return blended(made.mesh, photos_of(list(made.cameras.values()), shots)).rgb


def under_true_light(made: Set, colors: VertexColors):
    """(V, 3) what the blend reflects of the light that was there."""
    caster, rays = LightCaster(made.mesh, colors.rgb), 96
    sky = sky_image(replace(made.light, sun=(0.0, 0.0, 0.0)))
    height, width = sky.shape[:2]
    shifts = np.random.default_rng(0).random((len(colors.rgb), 2), np.float32)
    light = np.empty_like(colors.rgb)
    for start in range(0, len(light), 4096):
        rows = np.arange(start, min(start + 4096, len(light)))
        d = cosine_directions(caster.normals[rows], shifts[rows], rays).reshape(-1, 3)
        free, arriving = caster._arriving(rows, d)
        row = np.arccos(np.clip(d[:, 1], -1, 1)) / np.pi * height
        column = np.arctan2(d[:, 0], -d[:, 2]) % (2 * np.pi) / (2 * np.pi) * width
        seen = sky[row.astype(int).clip(0, height - 1), column.astype(int).clip(0, width - 1)]
        light[rows] = (seen * free[:, None] + arriving).reshape(-1, rays, 3).mean(axis=1)
    if any(made.light.sun):
        sun = caster.sun(caster.cells.spots(np.arange(len(light)), 8), made.light.to_sun)
        light += sun[:, None] * np.asarray(made.light.sun, np.float32)
    return base_color(colors.rgb / np.maximum(light, 0.01))


def relit(made: Set, found, blend) -> None:
    """PSNR of the piece by lamps elsewhere, each color at its best scale."""
    lamps = []
    for turn, (azimuth, elevation) in enumerate(LAMPS):
        camera = list(made.cameras.values())[5 * turn]
        away = camera.center - made.mesh.center
        around = np.arctan2(away[1], away[0]) + azimuth
        toward = [np.cos(elevation) * np.cos(around), np.cos(elevation) * np.sin(around)]
        place = made.mesh.center + 1.5 * made.mesh.diagonal * np.array([*toward, np.sin(elevation)])
        lamps.append((camera, place))
    power = 0.7 * np.pi * (1.5 * made.mesh.diagonal) ** 2

    def drawn(mesh: Mesh, rgb) -> list[Pair]:
        flat = np.zeros(len(rgb), np.float32)
        room = DarkRoom(mesh, Truth(np.clip(rgb, 0.003, 0.99), flat + 0.7, flat, flat))
        return [room.twice(camera, place, power, k) for k, (camera, place) in enumerate(lamps)]

    shots = [
        Shot(*lamp, power, x) for lamp, x in zip(lamps, drawn(made.true, made.paint), strict=True)
    ]
    line = []
    truth = made.albedo
    for name, rgb in (("truth", truth), ("base", found), ("blend", blend)):
        scale = np.median(truth, axis=0) / np.median(np.maximum(rgb, 1e-3), axis=0)
        line.append(f"{name} {psnr(shots, drawn(made.mesh, rgb * scale)):.1f}")
    print(f"relit, tint known, dB: {', '.join(line)}")


def natural(made: Set, what: str, gold: bool) -> None:
    """The lines of a set in natural light."""
    shots = shots_of(made)
    colors = blended(made.mesh, shots)
    start = time.process_time()
    found = natural_appearance(made.mesh, colors.rgb, colors.weight > 0)
    seconds = time.process_time() - start
    print(f"\n{what}: {found.reason or 'accepted'} {found.verdict}")
    light = found.light
    if light is not None and light.to_sun is not None:
        print(f"sun {angle_deg(light.to_sun, made.light.to_sun):.2f} degrees off")
    else:
        print("no sun")
    print(f"{seconds:.1f} s of CPU for {len(colors.rgb)} points")
    three = lines(made, colors, found)
    told("true light", made, under_true_light(made, colors), *three)
    if not gold:
        relit(made, found.base, colors.rgb)


def lines(made: Set, colors: VertexColors, found: Appearance):
    """Those of the blend and of the base color; which points are seen, in cavities, and surer."""
    seen = colors.photo_count >= 3
    cavity = ambient_occlusion(made.mesh)[seen] < CAVITY
    sure = found.confidence[seen] >= np.median(found.confidence[seen])
    told("blend", made, colors.rgb, seen, cavity, sure)
    told("base", made, found.base, seen, cavity, sure)
    told("paint alone", made, paint_alone(made), seen, cavity, sure)
    return seen, cavity, sure


def turned(made: Set, kind: str) -> None:
    """The lines of a set on a turntable, which is to be told by itself."""
    shots = shots_of(made)
    colors = blended(made.mesh, shots)
    start = time.process_time()
    blend = Blended(colors.rgb, colors.weight > 0)
    with open_renderer(RenderOptions()) as renderer:
        found = turntable_appearance(made.mesh, shots, renderer, blend, True, lambda *_: None)
    seconds = time.process_time() - start
    print(f"\n{kind}, turntable: {found.reason or 'accepted'} {found.verdict}")
    print(f"{seconds:.1f} s of CPU for {len(colors.rgb)} points, {len(made.photos)} photos")
    lines(made, colors, found)
    relit(made, found.base, colors.rgb)


def shots_of(made: Set) -> PhotoSet:
    """Its photos."""
    shots = [Photo(PhotoInfo(n, *x.shape[1::-1]), x) for n, x in made.photos.items()]
    return photos_of(list(made.cameras.values()), shots)


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
    parser.add_argument("--what", choices=("natural", "turntable"), default="natural")
    parser.add_argument("--photos", type=int)
    parser.add_argument("--samples", type=int)
    parser.add_argument("--width", type=int, default=SIZE[0], help="of photos in natural light")
    parser.add_argument("--only", choices=SEEDS)
    parser.add_argument("--gold", action="store_true", help="metal, which it is not made for")
    parser.add_argument("--real", type=Path, nargs="*", default=[])
    asked = parser.parse_args()
    for root in asked.real:
        real(root)
    for kind, seed in () if asked.real else SEEDS.items():
        if asked.only not in (None, kind):
            continue
        if asked.what == "turntable":
            made = turntable_set(kind, asked.photos or 24, asked.samples or 24, seed)
            turned(made, kind)
            continue
        for weather in ("sun", "cloudy"):
            count = asked.photos or 12, asked.samples or 16
            made = natural_set(kind, weather, *count, asked.gold, seed, asked.width)
            natural(made, f"{kind}, {weather}", asked.gold)


if __name__ == "__main__":
    main()
