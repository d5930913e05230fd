"""Pictures for the report: the mesh's edges over a photo, picks with their residuals, the model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Bytes
from texproj.camera import Camera, Intrinsics, Pose
from texproj.mesh import Mesh
from texproj.photo import Correspondences, Photo
from texproj.render import GBuffer

Direction = NDArray[np.float64]

OVERLAY_LONGEST = 800
"""Longer side of a photo in the report, pixels."""
VIEW_SIZE = (640, 480)
"""Width and height of a view of the model, pixels."""
VIEW_ANGLES_DEG = (0.0, -55.0, 55.0)
"""Turns about the upward axis from where most photos were taken: front, one side, the other."""
VIEW_ELEVATION_DEG = 12.0
VIEW_DISTANCE = 1.5
"""From the middle of the mesh, in diagonals of its bounding box."""
VIEW_FILLED = 0.94
"""Part of a view that the mesh fills."""
RESIDUAL_MAGNIFICATION = 20
"""Residuals of a pixel or so would be invisible in a reduced photo."""
EDGE_DEPTH_RATIO = 0.01
"""A step in depth of more than this part of the depth is an edge to draw."""
EDGE_NORMAL_COSINE = 0.8
"""A turn of the normal between neighboring pixels past this cosine is one too."""

BACKDROP = 43
"""Gray behind the model: dark, so that holes are not taken for bright stone."""
EDGE_COLOR = (0, 255, 255)
HIDDEN_COLOR = (255, 0, 255)
PICK_COLOR = (80, 255, 80)
OUTLIER_COLOR = (255, 60, 60)


def overlay(photo: Photo, gbuffer: GBuffer) -> Bytes:
    """(h, w, 3) uint8: the photo with the edges of the mesh as its camera sees them.

    gbuffer: depth and normals rendered at the photo's size. Where the lines follow the picture,
    the registration is right.
    """
    picture = encoded(photo)
    edges = mesh_edges(gbuffer)
    picture[cv2.dilate(edges, np.ones((2, 2), np.uint8)) > 0] = EDGE_COLOR
    return picture


def marked_hidden(picture: Bytes, free: Bytes) -> Bytes:
    """The picture with what is left out of it (0 in `free`, of any size) in magenta."""
    size = (picture.shape[1], picture.shape[0])
    hidden = cv2.resize(free, size, interpolation=cv2.INTER_NEAREST) == 0
    out = picture.copy()
    out[hidden] = (out[hidden] * 0.5 + np.array(HIDDEN_COLOR) * 0.5).astype(np.uint8)
    return out


def mesh_edges(gbuffer: GBuffer) -> Bytes:
    """(h, w) uint8: 1 on silhouettes and creases."""
    depth, normal = gbuffer.require("depth"), gbuffer.require("normal")
    edges = np.zeros(depth.shape, np.uint8)
    for axis in (0, 1):
        first, second = _neighbors(depth, axis), _neighbors(normal, axis)
        near = np.minimum(*first)
        with np.errstate(invalid="ignore"):
            step = np.abs(first[0] - first[1]) > EDGE_DEPTH_RATIO * near
        crease = (second[0] * second[1]).sum(-1) < EDGE_NORMAL_COSINE
        mark = (step | crease) & np.isfinite(near)
        view = edges[:-1] if axis == 0 else edges[:, :-1]
        view[mark] = 1
    return edges


def _neighbors(image: NDArray[np.float32], axis: int) -> tuple[NDArray[np.float32], ...]:
    if axis == 0:
        return image[:-1], image[1:]
    return image[:, :-1], image[:, 1:]


def draw_picks(
    picture: Bytes, camera: Camera, picks: Correspondences, outliers: Sequence[str]
) -> Bytes:
    """The picture with each pick as a circle and its residual, magnified, as a line.

    camera: for the full-size photo that `picture` shows reduced.
    """
    picture = picture.copy()
    scale = picture.shape[1] / camera.width
    projected, _ = camera.project(picks.xyz_in_world)
    for name, xy, found in zip(picks.names, picks.xy_px, projected, strict=True):
        color = OUTLIER_COLOR if name in outliers else PICK_COLOR
        at = tuple(int(v) for v in xy * scale)
        cv2.circle(picture, at, 5, color, 1, cv2.LINE_AA)
        if np.isfinite(found).all():
            shift = np.clip((found - xy) * RESIDUAL_MAGNIFICATION, -1e4, 1e4)
            end = tuple(int(v) for v in (xy + shift) * scale)
            cv2.line(picture, at, end, color, 1, cv2.LINE_AA)
        label = (at[0] + 7, at[1] - 5)
        cv2.putText(picture, name, label, cv2.FONT_HERSHEY_SIMPLEX, 0.4, color, 1, cv2.LINE_AA)
    return picture


def encoded(photo: Photo) -> Bytes:
    """(h, w, 3) uint8 sRGB of a photo, its own copy."""
    return np.array(photo.srgb8())


def on_backdrop(picture: Bytes) -> Bytes:
    """(h, w, 3) of a (h, w, 4) picture, on dark gray where it is transparent."""
    alpha = picture[..., 3:].astype(np.float32) / 255
    return np.round(picture[..., :3] * alpha + BACKDROP * (1 - alpha)).astype(np.uint8)


class Front(NamedTuple):
    """How somebody stands before a mesh. up: upward, level: towards him; (3,) unit vectors at right
    angles, in the scan's frame.
    """

    up: Direction
    level: Direction


def front_of(mesh: Mesh, cameras: Sequence[Camera], up: Sequence[float]) -> Front:
    """Before the mesh from where most photos were taken. up: (3,) unit, how the scan stands."""
    upward, front = np.array(up, np.float64), _frontal(cameras, mesh.center)
    level = front - upward * (front @ upward)
    if np.linalg.norm(level) < 1e-6:  # all photos from above
        level = np.cross(upward, np.roll(upward, 1))
    return Front(upward, _unit(level))


def viewpoints(mesh: Mesh, front: Front) -> list[Camera]:
    """Cameras around the mesh, the first from its front."""
    views = around(mesh, front, VIEW_ANGLES_DEG, VIEW_SIZE)
    return [Camera(_filling_lens(mesh, [view.pose], VIEW_SIZE), view.pose) for view in views]


def around(
    mesh: Mesh, front: Front, angles_deg: Sequence[float], size: tuple[int, int]
) -> list[Camera]:
    """Cameras of one lens around the mesh, turned by these angles from the front; size: width and
    height of their pictures.
    """
    up, level = front
    elevation = np.radians(VIEW_ELEVATION_DEG)
    back = np.cos(elevation) * level + np.sin(elevation) * up
    poses = []
    for angle_deg in angles_deg:
        turn = cv2.Rodrigues(up * np.radians(angle_deg))[0]
        center = mesh.center + VIEW_DISTANCE * mesh.diagonal * turn @ back
        poses.append(Pose.look_at(center, mesh.center, up))
    lens = _filling_lens(mesh, poses, size)
    return [Camera(lens, pose) for pose in poses]


def _filling_lens(mesh: Mesh, poses: Sequence[Pose], size: tuple[int, int]) -> Intrinsics:
    """A lens of the size of the views in which the mesh just fits, whichever the view."""
    width, height = size
    reach = np.full(2, 1e-9)
    for pose in poses:
        xyz = pose.apply(mesh.vertices)
        reach = np.maximum(reach, np.abs(xyz[:, :2] / xyz[:, 2:]).max(0))
    focal = VIEW_FILLED / 2 * float(np.min((width, height) / reach))
    return Intrinsics(width, height, focal, focal, width / 2, height / 2)


def _frontal(cameras: Sequence[Camera], center: NDArray[np.float64]) -> NDArray[np.float64]:
    """Direction from the mesh to the camera that has most others around it."""
    if not cameras:
        return np.array([0.0, -1, 0])
    backs = np.array([_unit(camera.center - center) for camera in cameras])
    return backs[((backs @ backs.T).clip(0) ** 4).sum(1).argmax()]


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return vector / max(float(np.linalg.norm(vector)), 1e-12)
