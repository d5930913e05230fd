"""Corresponding points as a careful person would click them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.demo.caster import Caster
from texproj.mesh import Mesh, vertex_normals
from texproj.photo import Correspondences


def picked(
    mesh: Mesh, camera: Camera, count: int, sigma_px: float, rng: np.random.Generator
) -> Correspondences:
    """`count` visible vertices spread over the picture, their pixels off by sigma_px per axis."""
    seen = np.flatnonzero(visible(mesh, camera))
    candidates = rng.choice(seen, min(len(seen), 2000), replace=False)
    xy, _ = camera.project(mesh.vertices[candidates])
    chosen = _spread(xy, count, rng)
    noisy = xy[chosen] + rng.normal(0, sigma_px, (len(chosen), 2))
    return Correspondences(noisy, mesh.vertices[candidates[chosen]])


def visible(mesh: Mesh, camera: Camera, least_cosine: float = 0.35) -> NDArray[np.bool_]:
    """(V,) vertices inside the picture, facing the camera by at least that cosine, unhidden."""
    xy, _ = camera.project(mesh.vertices)
    to_eye = camera.center - mesh.vertices
    distance = np.linalg.norm(to_eye, axis=1)
    to_eye /= distance[:, None]
    normals = vertex_normals(mesh)
    margin = 0.02 * camera.width
    size = (camera.width, camera.height)
    inside = np.all((xy > margin) & (xy < np.array(size) - margin), axis=1)
    facing = np.einsum("ij,ij->i", normals, to_eye) > least_cosine
    ok = np.flatnonzero(inside & facing)
    caster = Caster(mesh, mesh.center)
    start = mesh.vertices[ok] + normals[ok] * (1e-3 * mesh.diagonal) - mesh.center
    blocked = caster.blocked(start.astype(np.float32), to_eye[ok].astype(np.float32))
    out = np.zeros(len(xy), bool)
    out[ok[~blocked]] = True
    return out


def _spread(xy: NDArray[np.float64], count: int, rng: np.random.Generator) -> NDArray[np.int_]:
    """Indices of points chosen one after the other, each the farthest from those before."""
    chosen = [int(rng.integers(len(xy)))]
    far = np.full(len(xy), np.inf)
    while len(chosen) < min(count, len(xy)):
        far = np.minimum(far, np.linalg.norm(xy - xy[chosen[-1]], axis=1))
        chosen.append(int(far.argmax()))
    return np.array(chosen)
