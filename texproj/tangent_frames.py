"""Directions on the pages of an atlas: tangents as glTF has them, and normals as colors.

glTF 2.0, sections 3.7.2.1 (TANGENT) and 3.9.3 (normal texture).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Floats
from texproj.mesh import Mesh, vertex_normals

FLAT = (128, 128, 255)
"""A normal map's color where the surface is as the mesh says."""


def tangent_frames(mesh: Mesh, uv_px: Doubles, faces: NDArray[np.int32]) -> Doubles:
    """(T, 4) of each texture vertex: the way on the surface to the right of the page, without its
    part along the normal, and the side on which upwards lies.
    """
    corners, uv = mesh.vertices[mesh.faces], uv_px[faces] * (1, -1)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    (a, b), (c, d) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    turn = np.sign(a * d - b * c)
    right = (e1 * d[:, None] - e2 * b[:, None]) * turn[:, None]
    flat = faces.ravel()
    sums = [np.bincount(flat, np.repeat(column, 3), len(uv_px)) for column in (*right.T, turn)]
    vertex = np.zeros(len(uv_px), np.int64)
    vertex[flat] = mesh.faces.ravel()
    normal = vertex_normals(mesh)[vertex]
    tangent = np.stack(sums[:3], axis=1)
    tangent -= normal * np.einsum("ij,ij->i", tangent, normal)[:, None]
    size = np.linalg.norm(tangent, axis=1)
    lost = size < 1e-300
    tangent[lost] = _across(normal[lost])
    size[lost] = np.linalg.norm(tangent[lost], axis=1)
    side = np.where(sums[3] < 0, -1.0, 1.0)
    return np.concatenate([tangent / size[:, None], side[:, None]], axis=1)


def _across(normal: Doubles) -> Doubles:
    """(n, 3) some direction across each normal, not zero."""
    axis = np.where(np.abs(normal[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    without = ~np.any(normal, axis=1, keepdims=True)
    return np.cross(normal, axis) + np.where(without, axis, 0.0)


def directions_as_colors(wanted: Floats, normal: Floats, tangent: Floats) -> NDArray[np.uint8]:
    """(n, 3) directions in the frames of tangents (n, 4), normals (n, 3) as colors."""
    right, up = _axes(normal, tangent)
    parts = [np.einsum("ij,ij->i", wanted, axis) for axis in (right, up, normal)]
    return np.round(np.stack(parts, axis=1) * 127.5 + 127.5).clip(0, 255).astype(np.uint8)


def colors_as_directions(colors: Floats, normal: Floats, tangent: Floats) -> Floats:
    """(n, 3) unit directions of colors (n, 3) in 0..1, in the frames of normals (n, 3) and tangents
    (n, 4).
    """
    x, y, z = (2 * colors - 1).T
    right, up = _axes(normal, tangent)
    return unit(x[:, None] * right + y[:, None] * up + np.maximum(z, 1e-3)[:, None] * normal)


def _axes(normal: Floats, tangent: Floats) -> tuple[Floats, Floats]:
    """(n, 3) to the right and upwards on the page."""
    right = unit(tangent[:, :3] - normal * np.einsum("ij,ij->i", tangent[:, :3], normal)[:, None])
    return right, np.cross(normal, right) * np.where(tangent[:, 3:] < 0, -1, 1)


def unit(vectors: Floats) -> Floats:
    """(n, 3) of length 1."""
    size = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return np.asarray(vectors / np.maximum(size, np.float32(1e-20))[:, None], np.float32)
