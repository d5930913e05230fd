"""Pictures in another light against those of a path tracer (Mitsuba, five bounces).

    pip install mitsuba
    python tests/bench_relight.py [--keep FOLDER]

A carved piece of painted stone (Disney's principled surface, roughness .7) and one of gold (.4),
base color known: what differs is the renderer alone. Lights: a cloudy sky, a sky with a sun disk in
the picture of it, a lamp 1.5 diagonals away. PSNR of linear light over the pixels that show the
piece, the 99th percentile as white; both pictures exposed alike; processor time of texproj's.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from appearance_scenes import DAYS, _gold, _shape, all_around, sensor, sky_image

from texproj.appearance.relight import (
    Development,
    Environment,
    Illumination,
    Lamp,
    LitSurface,
    relit_pictures,
)
from texproj.appearance.relight.tone import metered
from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.demo.object import carved, piece
from texproj.demo.pattern import painted
from texproj.mesh import ColoredMesh, Mesh
from texproj.photo import srgb_from_linear
from texproj.render import open_renderer

SAMPLES = 64


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path)
    folder = parser.parse_args().keep
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    mesh = carved(piece("capital", 3), 60_000)
    camera = all_around(mesh, 3, 3)[1]
    print("| piece | light | PSNR dB | mean over the other's | s |")
    for gold in (False, True):
        pattern = _gold if gold else painted(3)
        base = pattern(mesh.vertices.astype(np.float32)).astype(np.float32)
        for light in ("cloudy", "sun", "lamp"):
            truth = traced(mi, mesh, base, gold, light, camera)
            start = time.process_time()
            mine = relit(mesh, base, gold, light, camera)
            seconds = time.process_time() - start
            seen = mine[..., 3] > 0.999
            a, b = mine[seen, :3], truth[seen]
            white = np.percentile(b, 99)
            error = np.clip(a / white, 0, 1) - np.clip(b / white, 0, 1)
            psnr = -10 * np.log10((error**2).mean())
            name = "gold" if gold else "stone"
            print(f"| {name} | {light} | {psnr:.1f} | {a.mean() / b.mean():.3f} | {seconds:.1f} |")
            if folder is not None:
                both = np.hstack([mine, np.dstack([truth, mine[..., 3]])])
                shown = Development(metered(mine), "none").developed(both)
                cv2.imwrite(str(folder / f"{name}_{light}.png"), shown[..., 2::-1])


def traced(mi: Any, mesh: Mesh, base: Floats, gold: bool, light: str, camera: Camera) -> Floats:
    """(h, w, 3) luminance by Mitsuba."""
    scene: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 6},
        "piece": _shape(mi, mesh, base, gold),
    }
    if light == "lamp":
        lamp = lamp_of(mesh)
        scene["lamp"] = {
            "type": "point", "position": lamp.place.tolist(),
            "intensity": {"type": "rgb", "value": lamp.intensity.tolist()},
        }  # fmt: skip
    else:
        scene["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(sky_image(DAYS[light]))}
    film = sensor(mi, camera, SAMPLES)
    return np.array(mi.render(mi.load_dict(scene), sensor=film, spp=SAMPLES), np.float32)[..., :3]


def relit(mesh: Mesh, base: Floats, gold: bool, light: str, camera: Camera) -> Floats:
    """(h, w, 4) luminance times alpha, and alpha, by texproj."""
    encoded = np.round(srgb_from_linear(base) * 65535).astype(np.uint16)
    count = len(mesh.vertices)
    rough = np.full(count, 0.4 if gold else 0.7, np.float32)
    surface = LitSurface(
        ColoredMesh(mesh.vertices, mesh.faces, encoded), rough,
        np.full(count, float(gold), np.float32),
    )  # fmt: skip
    if light == "lamp":
        lights = Illumination(lamps=(lamp_of(mesh),))
    else:
        lights = from_sky(sky_image(DAYS[light]))
    with open_renderer() as renderer:
        return next(relit_pictures(renderer, surface, lights, [camera]))


def lamp_of(mesh: Mesh) -> Lamp:
    toward = np.array([0.5, -0.7, 0.5]) / np.linalg.norm([0.5, -0.7, 0.5])
    far = 1.5 * mesh.diagonal
    return Lamp(mesh.center + far * toward, np.full(3, np.pi * far**2))


def from_sky(picture: Floats) -> Illumination:
    """Mitsuba's envmap has +y up and its middle at +z; columns run to the left."""
    from texproj.appearance.relight import Sun

    environment, toward, power = Environment(
        picture, np.array([0.0, 1, 0]), np.array([0.0, 0, 1])
    ).parted()
    suns = () if toward is None or power is None else (Sun(toward, power),)
    return Illumination(environment, suns)


if __name__ == "__main__":
    main()
