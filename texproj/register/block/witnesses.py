"""The photos of a block that are asked where it belongs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera, Pose
from texproj.errors import InputError
from texproj.photo import Photo
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.structure.mirror import FLIP, mirrored_intrinsics
from texproj.register.structure.view import StructureView
from texproj.render import GBuffer, Render

LoadPhoto = Callable[[str], Photo]

WORKING_PX = 768
"""Longer side of the part of a photo that is compared."""
POOR = 0.3
"""A photo with fewer points than this part of the median is asked last."""


@dataclass(frozen=True, eq=False)
class Witness:
    """A photo, reduced, and its full-size camera in the block's frame. surface: (n, 3) points
    all over the mesh, world, from which it is told where in the photo the mesh is.
    """

    name: str
    in_block: Camera
    photo: Photo
    render: Render
    surface: Doubles

    def view(self, around: Camera) -> StructureView:
        """The part of the photo in which `around`, of the world, sees the mesh."""
        view = StructureView.of(self.photo, self._dotted, WORKING_PX, around)
        return replace(view, render=self.render)

    @property
    def mirrored(self) -> Witness:
        """The photo with left and right exchanged, in the block mirrored at x = 0."""
        photo = self.photo
        mask = None if photo.mask is None else cv2.flip(photo.mask, 1)
        flipped = replace(photo, pixels=cv2.flip(photo.pixels, 1), mask=mask)
        pose = self.in_block.pose
        camera = Camera(
            mirrored_intrinsics(self.in_block.intrinsics),
            Pose(FLIP @ pose.R @ FLIP, FLIP @ pose.t),
        )
        return replace(self, in_block=camera, photo=flipped)

    def _dotted(self, camera: Camera) -> GBuffer:
        """A rendering of the surface's points: it shows where the mesh ends, and costs little."""
        xy, depth = camera.project(self.surface)
        inside = camera.inside(xy)
        column, row = xy[inside].astype(int).T
        image = np.full((camera.height, camera.width), np.inf, np.float32)
        image[row, column] = depth[inside]
        return GBuffer(depth=image)


def called(
    block: Reconstruction, load_photo: LoadPhoto, render: Render, surface: Doubles, count: int
) -> tuple[tuple[Witness, ...], dict[str, str]]:
    """Up to `count` photos, those first that are far from each other; and why, by name, photos
    that cannot be read were passed over.
    """
    found: list[Witness] = []
    broken: dict[str, str] = {}
    for i in spread_photos(block):
        if len(found) == count:
            break
        name = block.names[i]
        try:
            found.append(Witness(name, block.cameras[i], load_photo(name), render, surface))
        except InputError as error:
            broken[name] = str(error)
    return tuple(found), broken


def spread_photos(block: Reconstruction) -> Sequence[int]:
    """The photos' numbers: the one with most points, then always the one farthest from all
    before, photos with few points last.
    """
    counts = np.bincount(block.observer, minlength=len(block.names))
    centers = np.array([camera.center for camera in block.cameras])
    poor = counts < POOR * np.median(counts)
    order = [int(counts.argmax())]
    distance = np.full(len(counts), np.inf)
    while len(order) < len(counts):
        distance = np.minimum(distance, np.linalg.norm(centers - centers[order[-1]], axis=1))
        left = np.setdiff1d(np.arange(len(counts)), order)
        order.append(int(left[np.lexsort((-distance[left], poor[left]))[0]]))
    return order
