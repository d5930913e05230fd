"""Photographs of a lump in a dark room, a flash beside the camera, by exact rays: without bounces,
but of a surface whose highlights are not those that are fitted: half GGX and half Beckmann, Cook
and Torrance's grooves, exact Fresnel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from texproj.appearance.brdf.distributions import GGX, Beckmann
from texproj.appearance.brdf.fresnel import Dielectric
from texproj.appearance.brdf.shadowing import cook_torrance
from texproj.camera import Camera, Intrinsics, Pose
from texproj.demo.noise import noise
from texproj.mesh import Mesh, vertex_normals
from texproj.photo import srgb_from_linear
from texproj.render.rays import RayCaster

LAMP = np.array([0.06, -0.05, 0.01])
SIZE = (240, 180)
DISTANCE = 0.9
INTENSITY = 0.5 * np.pi * DISTANCE**2
ROUGHNESS = (0.85, 0.36, 0.48)
BECKMANN = 0.5
METALLIC = (0.0, 0.0, 1.0)
RELIEF_LENGTH = 0.03
"""Of the waves of a relief that the mesh knows nothing of, metres."""
COLORS = np.array([[0.5, 0.42, 0.35], [0.1, 0.18, 0.4], [0.9, 0.66, 0.32]])


@dataclass(frozen=True, eq=False)
class Lump:
    """mesh; kind (V,) of each vertex; cameras; uint8 photos; output of each flash."""

    mesh: Mesh
    kind: np.ndarray
    cameras: list[Camera]
    photos: list[np.ndarray]
    output: np.ndarray


def lump_mesh(subdivisions: int = 5) -> Mesh:
    """A ball of 30 cm with dents."""
    ball = trimesh.creation.icosphere(subdivisions, 0.15)
    xyz = np.asarray(ball.vertices, np.float32)
    dented = xyz * (1 + 0.09 * waves(xyz, 0.22, 3))[:, None]
    return Mesh(dented.astype(float), np.asarray(ball.faces))


def kinds(xyz: np.ndarray) -> np.ndarray:
    """Stone, paint or gold at points (n, 3)."""
    xyz = np.asarray(xyz, np.float32)
    one, other = waves(xyz, 0.2, 1), waves(xyz, 0.19, 7)
    return np.where(one > 0.5, 1, np.where(other > 0.5, 2, 0))


def waves(xyz: np.ndarray, length: float, seed: int) -> np.ndarray:
    """(n,) a smooth function of points (n, 3), about -1..1."""
    rng = np.random.default_rng(seed)
    toward = rng.standard_normal((5, 3))
    toward *= 2 * np.pi / length / np.linalg.norm(toward, axis=1, keepdims=True)
    return np.sin(xyz @ toward.T + rng.uniform(0, 6, 5)).sum(axis=1) / 1.6


def colors(xyz: np.ndarray, kind: np.ndarray) -> np.ndarray:
    """(n, 3) base colors."""
    fine = noise(np.asarray(xyz, np.float32), 0.03, 13, 1.2)[:, None]
    return COLORS[kind] * (1 + np.array([0.15, 0.06, 0.03])[kind][:, None] * fine)


def reflected(kind: np.ndarray, base: np.ndarray, wi, wo) -> np.ndarray:
    """(n, 3) reflectance without the cosine; directions in the frame of the surface."""
    half = wi + wo
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    cosine = np.einsum("ij,ij->i", half, wo)
    out = np.zeros_like(base)
    for number in range(3):
        rows = kind == number
        i, o, h = wi[rows], wo[rows], half[rows]
        alpha = ROUGHNESS[number] ** 2
        d = BECKMANN * Beckmann(alpha).density(h) + (1 - BECKMANN) * GGX(alpha).density(h)
        s = d * cook_torrance(i, o, h) / (4 * i[:, 2] * o[:, 2])
        if METALLIC[number]:
            out[rows] = base[rows] * s[:, None]
        else:
            mirror = s * Dielectric(1.5)(cosine[rows])
            out[rows] = base[rows] / np.pi + mirror[:, None]
    return out


def relief_normals(xyz: np.ndarray, normal: np.ndarray, slope: float) -> np.ndarray:
    """(n, 3) normals (n, 3) tilted by a relief too flat to be seen from the side; slope: about its
    largest tangent.
    """
    xyz = np.asarray(xyz, np.float64)
    step = RELIEF_LENGTH * 1e-3
    steep = [
        waves(xyz + step * axis, RELIEF_LENGTH, 23) - waves(xyz - step * axis, RELIEF_LENGTH, 23)
        for axis in np.eye(3)
    ]
    gradient = np.stack(steep, axis=1) / (2 * step) * RELIEF_LENGTH / (2 * np.pi) * slope
    gradient -= normal * np.einsum("ij,ij->i", gradient, normal)[:, None]
    out = normal - gradient
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def lump(photos: int = 16, seed: int = 0, subdivisions: int = 5, slope: float = 0.0) -> Lump:
    """One set. slope: of a relief that is not in the mesh."""
    rng = np.random.default_rng(seed)
    mesh = lump_mesh(subdivisions)
    caster = RayCaster(mesh.vertices, mesh.faces)
    output = rng.uniform(0.85, 1.15, photos)
    cameras, pictures = [], []
    for number in range(photos):
        z = 1 - 2 * (number + 0.5) / photos
        angle = number * np.pi * (3 - np.sqrt(5))
        toward = np.array(
            [np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z]
        )
        f = SIZE[0] * 2.1
        k = Intrinsics(*SIZE, f, f, SIZE[0] / 2, SIZE[1] / 2)
        camera = Camera(k, Pose.look_at(DISTANCE * toward, [0, 0, 0]))
        cameras.append(camera)
        light = taken(mesh, caster, camera, LAMP, slope) * output[number]
        light += np.sqrt(np.maximum(light, 0) / 15000 + 0.0015**2) * rng.standard_normal(
            light.shape
        )
        pictures.append(np.round(srgb_from_linear(light) * 255).astype(np.uint8))
    return Lump(mesh, kinds(mesh.vertices), cameras, pictures, output)


def taken(
    mesh: Mesh, caster: RayCaster, camera: Camera, lamp: np.ndarray, slope: float
) -> np.ndarray:
    """(h, w, 3) radiance of a flash of output 1."""
    w, h = SIZE
    x, y = np.meshgrid(np.arange(w) + 0.5, np.arange(h) + 0.5)
    origins, rays = camera.rays(np.column_stack([x.ravel(), y.ravel()]))
    hits = caster.first(origins, rays)
    rows = np.flatnonzero(hits.face >= 0)
    part = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1)[rows]
    corner = mesh.faces[hits.face[rows]]
    n = np.einsum("nk,nkc->nc", part, vertex_normals(mesh)[corner])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    xyz = origins[rows] + rays[rows] * hits.depth[rows, None]
    n = relief_normals(xyz, n, slope)
    place = camera.pose.inverse.apply(lamp[None])[0]
    to_lamp = place - xyz
    distance = np.linalg.norm(to_lamp, axis=1, keepdims=True)
    wi, wo = _local(n, to_lamp / distance), _local(n, -rays[rows])
    wi[:, 2], wo[:, 2] = np.maximum(wi[:, 2], 0), np.maximum(wo[:, 2], 1e-3)
    lit = (wi[:, 2] > 1e-3) & ~caster.blocked(xyz + 1e-4 * n, to_lamp / distance)
    kind = kinds(xyz)
    wi[:, 2] = np.maximum(wi[:, 2], 1e-3)
    out = np.zeros((h * w, 3))
    shown = reflected(kind, colors(xyz, kind), wi, wo) * (wi[:, 2:] * INTENSITY / distance**2)
    out[rows] = np.where(lit[:, None], shown, 0)
    return out.reshape(h, w, 3)


def _local(n: np.ndarray, w: np.ndarray) -> np.ndarray:
    """(n, 3) directions with the normal as z; what is across is turned anyhow."""
    z = np.einsum("ij,ij->i", n, w)
    a = np.cross(n, [0.37, 0.61, 0.7])
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(n, a)
    return np.stack([np.einsum("ij,ij->i", a, w), np.einsum("ij,ij->i", b, w), z], axis=1)
