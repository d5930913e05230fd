"""How well materials are told under a flash: photographs by Mitsuba, and the speed of it.

    pip install mitsuba
    python tests/bench_flash.py                   # three sets of 36 and of 18 photos: half an hour
    python tests/bench_flash.py --only knot       # one of capital, stele, knot
    python tests/bench_flash.py --unknown         # the flash's strength is not given
    python tests/bench_flash.py --speed 1000000   # seconds and memory of a million points
    python tests/bench_flash.py --wall            # vignetting, flash and lamp by a white wall

Of each set it prints CIEDE2000 of the base color, median and 90 %, over vertices that at least 3
photos see, of the blend at its best scale and of the result as it is, also of points in few and in
many photos, and of photos of the paint alone, without light, gloss and noise, averaged: what is
left there is the measuring's; how often metals are told;
the mean error of roughness where it is below .6; and photos rendered anew, by Mitsuba on the scan
with what was found: 6 under the flash and 6 under a lamp elsewhere, beside those with a matte
surface and with the truth; then the same from texture pages, with the normals of the mesh and with
those that the photos tell. All are rendered twice, and what is told is the mean product of the two
differences: the renderer's noise, some 30 dB by itself, has no part in it.
MITSUBA_VARIANT=llvm_ad_rgb is several times faster where LLVM fits.
"""

from __future__ import annotations

import argparse
import resource
import time
from dataclasses import dataclass, replace

import cv2
import numpy as np
from appearance_scenes import SIZE
from flash_caster import INTENSITY as LUMP_INTENSITY
from flash_caster import LAMP as LUMP_LAMP
from flash_caster import lump
from flash_scenes import (
    LAMP,
    SHOT_SAMPLES,
    DarkRoom,
    FlashSet,
    Pair,
    Shot,
    Truth,
    flash_set,
    truth_at,
)
from photo_sets import photo_set as photos_of
from scipy.spatial import cKDTree
from skimage.color import deltaE_ciede2000

from texproj.appearance.flash.closed_form import fit_lambert
from texproj.appearance.flash.flash_pages import Given, SurfacePages, flash_pages
from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.recover import Blend, flash_appearance
from texproj.appearance.recovered import Appearance
from texproj.appearance.relight import Illumination, LitSurface, traced_pictures
from texproj.appearance.relight import Lamp as RoomLamp
from texproj.camera import Camera
from texproj.color.checker.fit import lab_of_srgb
from texproj.color.result import VertexColors, textured_mesh
from texproj.color.texture import color_texture
from texproj.color.vertices import color_vertices
from texproj.mesh import Mesh
from texproj.options import ColorOptions, RenderOptions, UnwrapOptions
from texproj.photo import Photo, PhotoInfo, srgb_from_linear
from texproj.render import open_renderer
from texproj.render.rays import RayCaster

SETS = (
    ("capital", "glazed", 4, True), ("stele", "gilded", 3, False), ("knot", "lacquered", 5, False),
)  # fmt: skip
FINER = (0.25, 0.75)
"""Where rays go through a pixel, across and down."""

SCALES = np.exp(np.linspace(-1.5, 1.5, 61))


@dataclass(frozen=True, eq=False)
class Told:
    """appearance; colors: the blend; pages: of the texture, None unless asked for; seconds: of
    processor time for the appearance of the vertices.
    """

    appearance: Appearance
    colors: VertexColors
    pages: SurfacePages | None
    seconds: float


def surface_of(mesh, cameras, pictures, lamp, textured=False) -> Told:
    """What the photos tell."""
    shots = [Photo(PhotoInfo(str(k), *x.shape[1::-1]), x) for k, x in enumerate(pictures)]
    photos = photos_of(cameras, shots)
    with open_renderer(RenderOptions()) as renderer:
        options = ColorOptions(to="vertices", highlight=1, occluders=False)
        colors = color_vertices(mesh, photos, renderer, options)
        start = time.process_time()
        blend = Blend(colors.rgb, colors.weight > 0)
        found = flash_appearance(mesh, photos, renderer, lamp, blend, lambda *_: None)
        seconds, pages = time.process_time() - start, None
        if textured:
            options = replace(options, to="texture")
            texture = color_texture(mesh, photos, renderer, options, UnwrapOptions())
            given = Given(mesh, texture, np.ones(len(mesh.vertices), np.float32))
            pages = flash_pages(given, photos, renderer, found)
    return Told(found, colors, pages, seconds)


def off(found, truth):
    """(n,) CIEDE2000."""
    return deltaE_ciede2000(lab_of_srgb(np.clip(found, 0, 1)), lab_of_srgb(truth))


def paint_alone(made: FlashSet, cameras: list[Camera], materials: str, seed: int) -> np.ndarray:
    """(V, 3) what photos of the paint itself tell, as if it shone, averaged where they are sure."""
    mesh, (w, h) = made.mesh, SIZE
    base = truth_at(mesh.vertices, materials, seed).base
    xyz = (mesh.vertices - mesh.center).astype(np.float32)
    caster = RayCaster(xyz, mesh.faces)
    pictures = []
    for camera in cameras:
        shown = np.zeros((h * w, 3), np.float32)
        for dx, dy in ((x, y) for x in FINER for y in FINER):
            x, y = np.meshgrid(np.arange(w) + dx, np.arange(h) + dy)
            origins, rays = camera.rays(np.column_stack([x.ravel(), y.ravel()]))
            origins = np.broadcast_to(origins - mesh.center, rays.shape).astype(np.float32)
            hits = caster.first(origins, rays.astype(np.float32))
            rows = np.flatnonzero(hits.face >= 0)
            part = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1)[rows]
            paint = np.einsum("nk,nkc->nc", part, base[mesh.faces[hits.face[rows]]])
            shown[rows] += paint / len(FINER) ** 2
        pictures.append(np.round(srgb_from_linear(shown.reshape(h, w, 3)) * 255).astype(np.uint8))
    shots = [Photo(PhotoInfo(str(k), w, h), x) for k, x in enumerate(pictures)]
    with open_renderer(RenderOptions()) as renderer:
        options = ColorOptions(to="vertices", blend="mean", occluders=False, align=False)
        return color_vertices(mesh, photos_of(cameras, shots), renderer, options).rgb


def median_and_90(name: str, error: np.ndarray) -> str:
    return f"{name} {np.median(error):.2f} / {np.percentile(error, 90):.2f}"


def anew(scan: Mesh, truth: Truth, shots: list[Shot], glossy: bool = True) -> list[Pair]:
    """The held-out photos of a surface."""
    room = DarkRoom(scan, truth, 0.5 if glossy else 0.0)
    return [room.twice(s.camera, s.lamp, s.intensity, k) for k, s in enumerate(shots)]


def from_pages(told: Told, made: FlashSet, shots: list[Shot], bumps: bool) -> list[Pair]:
    """The same of the texture."""
    assert told.pages is not None
    bump = told.pages.normal_map if bumps else None
    model = replace(textured_mesh(made.mesh, told.pages.base), normal_map=bump)
    found = told.appearance
    surface = LitSurface(model, found.roughness, found.metallic)
    pictures = []
    for shot in shots:
        lights = Illumination(lamps=(RoomLamp(shot.lamp, np.full(3, shot.intensity)),))
        drawn = traced_pictures(surface, lights, [shot.camera] * 2, samples=SHOT_SAMPLES)
        pictures.append(tuple(layers[..., :3] for layers in drawn))
    return pictures


def psnr(shots: list[Shot], pictures: list[Pair]) -> float:
    """Over all pixels that show the piece, but those at its outline; dB as shown, without the
    renderer's noise: it differs between two pictures, what is wrong with the surface does not.
    """
    square = []
    for shot, pair in zip(shots, pictures, strict=True):
        there = shot.shown & ((pair[0] + pair[1]).max(axis=2) > 0)
        inside = cv2.erode(there.astype(np.uint8), np.ones((3, 3))) > 0
        one, other = (
            srgb_from_linear(seen.clip(0, 1)) - srgb_from_linear(drawn.clip(0, 1))
            for seen, drawn in zip(shot.drawn, pair, strict=True)
        )
        square.append((one * other)[inside].ravel())
    return float(-10 * np.log10(max(np.concatenate(square).mean(), 1e-9)))


def report(name: str, made: FlashSet, every: int, unknown: bool, alone: np.ndarray) -> None:
    """The lines of one set. alone: (V, 3) what photos of the paint itself tell."""
    names = list(made.photos)[::every]
    cameras = [made.cameras[n] for n in names]
    lamp = Lamp(np.array(LAMP), intensity=None if unknown else made.intensity)
    told = surface_of(made.mesh, cameras, [made.photos[n] for n in names], lamp, every == 1)
    found, colors = told.appearance, told.colors
    seen, truth = colors.photo_count >= 3, made.truth
    print(f"\n{name}, {len(names)} photos: {found.reason or 'accepted'}")
    print(f"  {found.verdict}")
    plain = min((off(colors.rgb[seen] * s, truth.base[seen]) for s in SCALES), key=np.median)
    ours = off(found.base[seen], truth.base[seen])
    kinds = truth.kind[seen]
    print(f"  {median_and_90('blend', plain)}   {median_and_90('base color', ours)}   ", end="")
    print(", ".join(median_and_90(str(k), ours[kinds == k]) for k in range(3)))
    sure = found.confidence[seen] >= np.median(found.confidence[seen])
    print(f"  {median_and_90('surer half', ours[sure])}", end="   ")
    for few, rows in (("in 3 to 5 photos", (3, 5)), ("in 12 and more", (12, 99))):
        some = (colors.photo_count[seen] >= rows[0]) & (colors.photo_count[seen] <= rows[1])
        print(median_and_90(few, ours[some]), end="   ")
    print(median_and_90("paint alone", off(alone[seen], truth.base[seen])))
    if found.light is None:
        return
    metal = truth.metallic[seen] > 0.5
    right = (found.metallic[seen] > 0.5) == metal
    print(f"  metal right {right.mean():.3f}, surer half {right[sure].mean():.3f}", end="")
    print(f"; false metal {(~right)[~metal].mean():.3f}", end="")
    smooth = truth.roughness[seen] < 0.6
    miss = np.abs(found.roughness - truth.roughness)[seen]
    print(f"; roughness {miss[smooth].mean():.3f} where below .6")
    for one in found.light.found.materials:
        print(f"    {one.material} F0 {'told' if one.f0_known else 'not told'}")
    gain = found.light.found.flashes.gain / made.output[::every]
    print(f"  flashes' output {100 * np.std(gain / gain.mean()):.1f} % off", end="")
    print(f"; strength {found.light.found.lamp.intensity * gain.mean() / made.intensity:.3f} of it")
    print(f"  {told.seconds:.1f} s of CPU for {len(seen)} points")
    rendered(made, told)


def rendered(made: FlashSet, told: Told) -> None:
    """Photos rendered anew."""
    kind, found = made.truth.kind, told.appearance
    ours = Truth(found.base, found.roughness, found.metallic, kind)
    nodes = found.light.found
    xyz = made.mesh.vertices - made.mesh.center
    color = fit_lambert(nodes.seen).color[cKDTree(nodes.surfels.xyz).query(xyz)[1]]
    matte = Truth(color, np.ones(len(kind), np.float32), np.zeros(len(kind), np.float32), kind)
    for name, shots in (("flash", made.flash), ("lamp elsewhere", made.lamp)):
        values = [
            psnr(shots, anew(made.mesh, surface, shots, glossy))
            for surface, glossy in ((ours, True), (matte, False), (made.truth, True))
        ]
        print(
            f"  {name}: {values[0]:.1f} dB, matte {values[1]:.1f}, with the truth {values[2]:.1f}"
        )
        if told.pages is not None:
            bumpy = [False, True][: 1 + (told.pages.normal_map is not None)]
            drawn = [psnr(shots, from_pages(told, made, shots, own)) for own in bumpy]
            print(f"    from pages {', '.join(f'{value:.1f}' for value in drawn)} dB", end=" ")
            print(f"(normals of the mesh, of the photos); {told.pages.normals}")


def speed(points: int) -> None:
    """Seconds of processor time for so many points of 36 photos, and the peak of memory."""
    made = lump(36, subdivisions=max(4, round(np.log(points / 10) / np.log(4))))
    lamp = Lamp(LUMP_LAMP, intensity=LUMP_INTENSITY)
    start = time.time()
    told = surface_of(made.mesh, made.cameras, made.photos, lamp)
    count, seconds = len(told.colors.rgb), told.seconds
    seen = float(told.colors.photo_count.mean())
    reason = told.appearance.reason or "accepted"
    print(f"{count} points, each in {seen:.1f} of 36 photos, {reason}")
    print(f"{seconds:.0f} s of CPU, {seconds / count * 1e6:.0f} s per million points")
    print(f"{time.time() - start:.0f} s in all, with the blend; peak", end=" ")
    print(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


def main() -> None:
    """All that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--only", choices=[one[0] for one in SETS])
    parser.add_argument("--unknown", action="store_true")
    parser.add_argument("--speed", type=int)
    parser.add_argument("--wall", action="store_true")
    asked = parser.parse_args()
    if asked.speed:
        speed(asked.speed)
    elif asked.wall:
        from test_flash_wall import errors, fitted, wall

        fit = fitted(*wall())
        of_lens, of_flash, place = errors(fit.lamp)
        print(f"lens {100 * of_lens:.2f} %, flash {100 * of_flash:.2f} % rms,", end=" ")
        print(f"lamp {1000 * place:.2f} mm off {fit.reason}")
    else:
        for kind, materials, seed, exact in SETS:
            if asked.only not in (None, kind):
                continue
            made = flash_set(kind, materials, 36, asked.samples, seed, exact)
            alone = paint_alone(made, list(made.cameras.values()), materials, seed)
            for every in (1, 2):
                scan = "its own vertices" if exact else "a scan"
                report(f"{kind}, {materials}, {scan}", made, every, asked.unknown, alone)


if __name__ == "__main__":
    main()
