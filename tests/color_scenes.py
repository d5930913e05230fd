"""A plane with a known pattern, photographed by intersecting every pixel's ray with it: truth on
paper, made without any renderer.
"""

from collections.abc import Callable

import numpy as np

from texproj.camera import Camera, Intrinsics, Pose
from texproj.mesh import Mesh
from texproj.photo import Photo, PhotoInfo

SIZE = (240, 180)


def plane(cells: int = 24, z: float = 0.0, half: float = 1.0, up: bool = True) -> Mesh:
    """A square grid at height z that faces +z (or -z)."""
    line = np.linspace(-half, half, cells + 1)
    x, y = np.meshgrid(line, line)
    vertices = np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1)
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    b, c, d = a + 1, a + cells + 2, a + cells + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Mesh(vertices, faces if up else faces[:, ::-1])


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    faces = [m.faces + s for m, s in zip(meshes, starts, strict=True)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def moved(mesh: Mesh, offset) -> Mesh:
    return Mesh(mesh.vertices + np.asarray(offset), mesh.faces)


def camera(center, target=(0, 0, 0), focal: float = 220.0, dist=(0.0,) * 5, offset=(0, 0, 0)):
    w, h = SIZE
    k = Intrinsics(w, h, focal, focal, w / 2 + 3.25, h / 2 - 2.5, dist)
    offset = np.asarray(offset, float)
    center, target = np.asarray(center, float) + offset, np.asarray(target, float) + offset
    return Camera(k, Pose.look_at(center, target, (0, 1, 0)))


def pattern(x, y) -> np.ndarray:
    """Smooth linear colors in 0.15..0.65 of a place on the plane."""
    waves = [np.sin(5 * x + 1), np.cos(4 * y - 0.5), np.sin(3 * (x + y))]
    return np.stack([0.4 + 0.25 * wave for wave in waves], axis=-1)


def picture(
    view: Camera,
    colors: Callable = pattern,
    gain=1.0,
    offset=(0, 0, 0),
    z: float = 0.0,
    mask=None,
) -> Photo:
    """What the camera sees of the endless plane at height z, linear light, one ray per pixel: the
    patterns are smooth.
    """
    x, y = np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5)
    origin, ray = view.rays(np.stack([x.ravel(), y.ravel()], axis=1))
    origin = origin - np.asarray(offset)
    at = origin + ray * ((z - origin[:, 2]) / ray[:, 2])[:, None]
    light = colors(at[:, 0], at[:, 1]).reshape(view.height, view.width, 3)
    pixels = (light * np.asarray(gain)).astype(np.float32)
    return Photo(PhotoInfo("p.png", view.width, view.height), pixels, mask)
