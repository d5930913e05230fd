"""Time, memory and quality of the unwrap, on real meshes and on noise.

    /usr/bin/time -v python tests/bench_unwrap.py MESH [TEXELS_PER_UNIT] [PNG]
    /usr/bin/time -v python tests/bench_unwrap.py noise
    python tests/bench_unwrap.py MESH xatlas     (xatlas alone, for comparison: minutes)

MESH: any mesh file, e.g. $TEXPROJ_DATA/sceaux-castle/mesh.ply; PNG: where to draw the first
page, a color for each chart. Judge by the seconds of processor time.
"""

import resource
import sys
import time

import cv2
import numpy as np
import trimesh

from texproj.mesh import Mesh, face_areas
from texproj.options import UnwrapOptions
from texproj.unwrap.stretch import flat_areas, stretch, weighted_quantiles
from texproj.unwrap.unwrap import unwrap


def noisy_wall(side=320, sigma=0.5):
    """A flat wall of unit squares, half a unit of noise across it: faces tilt by 39 degrees."""
    y, x = np.divmod(np.arange(side * side), side)
    z = np.random.default_rng(0).normal(0, sigma, side * side)
    i = np.arange(side * side).reshape(side, side)
    a, b, c, d = i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    return Mesh(np.stack([x, y, z], axis=1) / side, faces)


def noisy_ball(level=7, sigma=0.3):
    """A sphere with noise of 0.3 edge lengths along the radius."""
    ball = trimesh.creation.icosphere(level)
    edge = np.median(np.linalg.norm(np.diff(ball.triangles[:, :2], axis=1), axis=2))
    noise = np.random.default_rng(0).normal(0, sigma * edge, (len(ball.vertices), 1))
    return Mesh(ball.vertices * (1 + noise), ball.faces)


def loaded(path):
    """The mesh of a file."""
    mesh = trimesh.load(path, process=False)
    return Mesh(mesh.vertices, mesh.faces)


def draw(atlas, path, longest=1400):
    """A PNG of the first page, a color for each chart."""
    scale = longest / max(atlas.page_sizes[0])
    width, height = (int(s * scale) + 1 for s in atlas.page_sizes[0])
    image = np.zeros((height, width, 3), np.uint8)
    colors = np.random.default_rng(1).integers(60, 256, (atlas.stats.charts, 3)).tolist()
    for face in np.flatnonzero(atlas.page_of_face == 0):
        corners = np.round((atlas.uv_px[atlas.faces[face]] * scale - 0.5) * 16).astype(np.int32)
        cv2.fillConvexPoly(image, corners, colors[atlas.chart_of_face[face]], shift=4)
    cv2.imwrite(path, image)


def measure(name, mesh, density):
    """One line of figures; the atlas."""
    start, wall = time.process_time(), time.perf_counter()
    atlas = unwrap(mesh, density, UnwrapOptions())
    seconds, wall = time.process_time() - start, time.perf_counter() - wall
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{name}: {len(mesh.faces)} faces, {seconds:.2f} s CPU, {wall:.2f} s, peak {peak:.0f} MB")
    print(f"  {atlas.stats} {atlas.page_sizes}")
    return atlas


def measure_xatlas(mesh):
    """The same figures for xatlas with its defaults."""
    import xatlas

    start = time.process_time()
    atlas = xatlas.Atlas()
    atlas.add_mesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    atlas.generate()
    seconds = time.process_time() - start
    _, faces, uv = atlas.get_mesh(0)
    uv = uv.astype(np.float64) * [atlas.width, atlas.height]
    ratio = stretch(mesh.vertices[mesh.faces], uv[faces])
    median, p95 = weighted_quantiles(ratio, face_areas(mesh), (0.5, 0.95))
    fill = flat_areas(uv, faces.astype(np.int64)).sum() / (atlas.width * atlas.height)
    print(
        f"xatlas: {seconds:.1f} s CPU, {atlas.chart_count} charts, stretch {median:.3f} {p95:.3f}"
    )
    print(f"  packed {fill:.3f} at {atlas.width} x {atlas.height}, {atlas.atlas_count} pages")


def main():
    """Measure what the command line names."""
    name, *rest = sys.argv[1:]
    if name == "noise":
        measure("wall", noisy_wall(), 500.0)
        measure("ball", noisy_ball(), 500.0)
    elif rest[:1] == ["xatlas"]:
        measure_xatlas(loaded(name))
    else:
        atlas = measure(name, loaded(name), float(rest[0]) if rest else 400.0)
        if rest[1:]:
            draw(atlas, rest[1])


if __name__ == "__main__":
    main()
