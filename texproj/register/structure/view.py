"""A photo and a renderer brought to the same scales and compared patch by patch."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles, Floats
from texproj.camera import Camera
from texproj.photo import Photo
from texproj.register.structure.crop import Window
from texproj.render import GBuffer, Render
from texproj.solve.matching import PatchMatches, match_patches, patch_grid
from texproj.solve.orientation import Field, photo_field, render_field

FINE, MIDDLE, COARSE = 0, 1, 2
"""Levels: the working size, a half and a quarter of it."""
LOOK_PX = 192
"""Longer side of the rendering that tells where in the photo the mesh is."""
MARGIN = 0.15
"""What is added around it, of the photo's longer side: how far a start may be off."""
WORTH_CROPPING = 0.85
"""Longer side of the part, relative to the photo's, above which the photo is taken whole."""
MOST_ENLARGED = 1.3
REACH_PX = 6
"""How far a pixel's value reaches in a field's gradients: kept clear of what is masked."""
RIM_PX = 3
"""Pixels along the mesh's outline that are left out: what lies behind is not in the mesh."""


@dataclass(frozen=True)
class PatchRule:
    """Which patches are sought where: square of `size_px` every `step_px`, within +-`radius_px`,
    at most `peaks` answers each; all in pixels of `level`.
    """

    level: int
    size_px: int
    step_px: int
    radius_px: int
    peaks: int = 1


@dataclass(frozen=True, eq=False)
class Observation:
    """What one comparison of photo and rendering gave, in pixels of its level.

    camera: at the level's size; rule: what was sought; grid_px: (patches, 2) centers of all
    patches sought; matches: what was found; xyz_in_world: (n, 3) surface points under the
    patch centers, one per match.
    """

    camera: Camera
    rule: PatchRule
    grid_px: Doubles
    matches: PatchMatches
    xyz_in_world: Doubles

    @property
    def patches(self) -> int:
        return len(self.grid_px)

    @property
    def offset_px(self) -> Doubles:
        """(n, 2) found minus predicted position, pixels of the level."""
        return self.matches.target_px - self.matches.source_px


@dataclass(frozen=True, eq=False)
class StructureView:
    """A photo's orientation fields at three sizes, and the renderer to compare them with.

    window: the part of the photo they show; fields: finest first; render: gives depth, normal
    and ambient occlusion for a camera; outline: count the mesh's outline as an edge, as is
    right where the mesh is complete and wrong where it ends and the object goes on.
    """

    window: Window
    fields: tuple[Field, ...]
    render: Render
    outline: bool = False

    @classmethod
    def of(cls, photo: Photo, render: Render, working_px: int, around: Camera) -> StructureView:
        """The part of the photo in which `around` (full size) sees the mesh, with a margin.

        working_px: longer side of that part at the finest level; a photo of fewer pixels is
        enlarged up to twice, so that patches stay small against the object.
        """
        window, part = _window(photo, render, around).cut(photo)
        size = min(working_px, MOST_ENLARGED * max(part.width, part.height))
        fields = tuple(_field(part, size / 2**k) for k in range(3))
        return cls(window, fields, _DrawnOnce(render))

    @property
    def mirrored(self) -> StructureView:
        """The view of the photo with left and right exchanged: an edge at angle a runs at -a."""
        flipped = tuple(np.ascontiguousarray(field[:, ::-1]).conj() for field in self.fields)
        return replace(self, window=self.window.mirrored, fields=flipped)

    def camera_at(self, camera: Camera, level: int) -> Camera:
        """The camera (full size) for the pixels of a level."""
        height, width = self.fields[level].shape
        return self.window.camera_of(camera, width, height)

    def full_camera(self, camera: Camera) -> Camera:
        """The camera of a level for the full-size photo."""
        return self.window.full_camera(camera)

    def rendering(self, camera: Camera, level: int) -> tuple[GBuffer, Field, NDArray[np.bool_]]:
        """What `camera` sees at `level`: images, orientation field, and where it counts."""
        images = self.render(self.camera_at(camera, level))
        solid = images.outside()
        inner = _eroded(solid, max(1, RIM_PX >> level))
        channels = _channels(images)
        if self.outline:
            # channels go on beyond the outline, which then is an edge of its own
            beyond = [_extended(channel, solid) for channel in channels]
            wide = cv2.dilate(solid.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
            return images, render_field([*beyond, solid.astype(np.float32)], wide), solid
        return images, render_field(channels, inner), inner

    def observe(self, camera: Camera, rule: PatchRule) -> Observation:
        """Match the patches of a rendering from `camera` (any size) to the photo."""
        images, field, valid = self.rendering(camera, rule.level)
        centers = patch_grid(valid, rule.size_px, rule.step_px)
        photo = self.fields[rule.level]
        matches = match_patches(field, photo, centers, rule.size_px, rule.radius_px, rule.peaks)
        x, y = centers[matches.patch].T
        here = self.camera_at(camera, rule.level)
        xyz = images.points(here, y, x)
        grid = centers.astype(np.float64) + 0.5
        return Observation(here, rule, grid, matches, xyz)


class _DrawnOnce:
    """A renderer that gives the last picture again where the same one is asked for: a camera is
    looked at with and without the mesh's outline, and for patches of several sizes.
    """

    def __init__(self, render: Render) -> None:
        self._render = render
        self._last: tuple[Camera, GBuffer] | None = None

    def __call__(self, camera: Camera) -> GBuffer:
        if self._last is None or not _same(self._last[0], camera):
            self._last = camera, self._render(camera)
        return self._last[1]


def _same(one: Camera, other: Camera) -> bool:
    a, b = one.pose, other.pose
    return (
        one.intrinsics == other.intrinsics and np.array_equal(a.R, b.R) and np.array_equal(a.t, b.t)
    )


def _window(photo: Photo, render: Render, around: Camera) -> Window:
    width, height = photo.info.width, photo.info.height
    solid = np.isfinite(render(around.reduced(LOOK_PX)).require("depth"))
    if not solid.any():
        return Window.whole(width, height)
    window = Window.around(solid, MARGIN, width, height)
    cropped = max(window.width, window.height) < WORTH_CROPPING * max(width, height)
    return window if cropped else Window.whole(width, height)


def _field(photo: Photo, longest_px: float) -> Field:
    factor = longest_px / max(photo.width, photo.height)
    size = (max(1, round(photo.width * factor)), max(1, round(photo.height * factor)))
    valid = None
    if photo.mask is not None:
        valid = _eroded(cv2.resize(photo.mask, size, interpolation=cv2.INTER_NEAREST) > 0, REACH_PX)
    reduce_ = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    gray = np.clip(cv2.resize(photo.gray(), size, interpolation=reduce_), 0, 1)
    return photo_field(gray, valid)


def _channels(images: GBuffer) -> list[Floats]:
    """Normal x, y, z and ambient occlusion."""
    normal = images.require("normal")
    return [*(np.ascontiguousarray(normal[..., k]) for k in range(3)), images.require("ao")]


def _eroded(solid: NDArray[np.bool_], rim_px: int) -> NDArray[np.bool_]:
    """Without its rim; what reaches beyond the picture has none there."""
    kernel = np.ones((2 * rim_px + 1,) * 2, np.uint8)
    border = {"borderType": cv2.BORDER_CONSTANT, "borderValue": 1}
    return cv2.erode(solid.astype(np.uint8), kernel, **border) > 0


def _extended(channel: Floats, solid: NDArray[np.bool_]) -> Floats:
    """The channel with the nearest solid pixel's value wherever it is not solid."""
    if not solid.any():
        return channel
    away = (~solid).astype(np.uint8)
    label = cv2.distanceTransformWithLabels(away, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)[1]
    value = np.zeros(int(label.max()) + 1, np.float32)
    value[label[solid]] = channel[solid]
    return np.where(solid, channel, value[label])
