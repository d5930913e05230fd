"""What a visitor hides in a photo of the demo, colored from the other photos, against the truth.

The demo's photos at their true cameras, what stands in front found and left out; CIEDE2000 at
random points of the scan. "hidden": what he hides; "hidden, no other": what no other photo sees
either, so that it is filled; "rest": all else that a photo sees.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from color_truth import FOOTPRINT, LEAST_COSINE, OFF_SURFACE, color_at, delta_e

from texproj.camera import Camera
from texproj.color.occluders.in_front import find_occluders
from texproj.color.result import textured_mesh
from texproj.color.sampling.photo_set import PhotoSet
from texproj.color.texture import color_texture
from texproj.demo.light import Lighting, unit
from texproj.demo.make import DemoProject, colors_on, make_demo
from texproj.demo.object import carved, piece
from texproj.demo.pattern import painted
from texproj.demo.photographer import Scene, set_up
from texproj.formats.photos import read_photo, read_photo_info
from texproj.mesh import face_areas, vertex_normals
from texproj.options import DemoOptions, RenderOptions
from texproj.photo import Photo
from texproj.render import open_renderer

POINTS = 40_000


@dataclass(frozen=True, eq=False)
class Points:
    """Random points near the true surface. face: (n,), at: (n, 3) on the scan; light: (n, 3) true;
    shown: (p, n) bool, by each photo; hidden: (p, n) bool, behind who stands in it.
    """

    face: np.ndarray
    at: np.ndarray
    light: np.ndarray
    shown: np.ndarray
    hidden: np.ndarray


def table(options: DemoOptions) -> None:
    """Print points, median and 95 % of each part."""
    demo = make_demo(options)
    points = _points(demo, _scene(options))
    with tempfile.TemporaryDirectory() as folder, open_renderer(RenderOptions()) as renderer:
        photos = _photos(demo, Path(folder))
        found = find_occluders(demo.mesh, photos, renderer)
        for name, occluder in found.items():
            free = cv2.imencode(".png", occluder.free)[1].tobytes()
            Path(folder, f"{name}.free.png").write_bytes(free)
        texture = color_texture(demo.mesh, photos, renderer)
    color = color_at(textured_mesh(demo.mesh, texture), points)
    visitor = points.hidden.sum(axis=1).argmax()
    hidden = points.hidden[visitor]
    left = (points.shown & ~points.hidden).any(axis=0)
    ratio = (points.light.mean(axis=1) + 1e-4) / (color.mean(axis=1) + 1e-4)
    gain = float(np.exp(np.median(np.log(ratio[left]))))  # brightness of the whole is a gauge
    error = delta_e(color * gain, points.light)
    print(f"visitor in {demo.photos[visitor].file}; found in {', '.join(found) or 'none'}")
    parts = {
        "hidden": hidden, "hidden, no other": hidden & ~left, "rest": left & ~hidden,
    }  # fmt: skip
    for name, part in parts.items():
        if part.any():
            median, p95 = np.quantile(error[part], [0.5, 0.95])
            print(f"{name:18} {part.sum():6} points {median:6.2f} {p95:6.2f}")


def _scene(options: DemoOptions) -> Scene:
    true = carved(piece(options.object, options.seed), options.carved_faces)
    origin = np.array(options.origin)
    true = replace(true, vertices=true.vertices + origin)
    pattern = painted(options.seed, options.paint)
    return set_up(true, pattern, Lighting(), gloss=options.gloss, origin=origin)


def _photos(demo: DemoProject, folder: Path) -> PhotoSet:
    for photo in demo.photos:
        (folder / photo.file).write_bytes(photo.encoded)

    def read(name: str) -> Photo:
        path, free = folder / name, folder / f"{name}.free.png"
        return read_photo(path, read_photo_info(path), [free] if free.exists() else [])

    return PhotoSet(tuple(p.file for p in demo.photos), tuple(p.truth for p in demo.photos), read)


def _points(demo: DemoProject, scene: Scene) -> Points:
    mesh, rng = demo.mesh, np.random.default_rng(5)
    area = face_areas(mesh)
    face = rng.choice(len(area), POINTS, p=area / area.sum())
    at = rng.dirichlet((1, 1, 1), POINTS)
    corners = mesh.faces[face]
    normals = unit(np.einsum("nk,nkc->nc", at, vertex_normals(mesh)[corners])).astype(np.float32)
    world = np.einsum("nk,nkc->nc", at, mesh.vertices[corners])
    xyz = (world - scene.origin).astype(np.float32)
    out = scene.caster.first_hits(xyz + np.float32(OFF_SURFACE) * normals, -normals)
    near = np.zeros(POINTS, bool)
    near[out.found] = out.distance < 2 * OFF_SURFACE
    face, at, world, xyz, normals = face[near], at[near], world[near], xyz[near], normals[near]
    light = colors_on(scene, xyz, normals, FOOTPRINT)[1]
    shown = np.stack([_shown(scene, p.truth, xyz, normals, world) for p in demo.photos])
    free = np.stack([_inside(p.truth, world, p.object_mask) for p in demo.photos])
    return Points(face, at, light, shown, shown & ~free)


def _shown(
    scene: Scene, camera: Camera, xyz: np.ndarray, normals: np.ndarray, world: np.ndarray
) -> np.ndarray:
    to_eye = unit((camera.center - scene.origin).astype(np.float32) - xyz)
    facing = np.einsum("ij,ij->i", normals, to_eye) > LEAST_COSINE
    open_ = ~scene.caster.blocked(xyz + 1e-3 * normals + 1e-3 * to_eye, to_eye)
    everything = np.ones((camera.height, camera.width), np.uint8)
    return facing & open_ & _inside(camera, world, everything)


def _inside(camera: Camera, world: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(n,) bool: in the picture, where the (h, w) mask is not 0."""
    column, row = np.nan_to_num(np.floor(camera.project(world)[0]), nan=-1).astype(int).T
    inside = (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
    inside[inside] = mask[row[inside], column[inside]] > 0
    return inside
