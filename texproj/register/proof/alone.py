"""What one photo and the mesh say of a camera: the mesh is in view, from outside, and its edges are
where the photo has some.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from texproj.camera import Camera
from texproj.photo import Photo
from texproj.register.proof.texture import textured
from texproj.register.structure.solve import CHECK, LAST, found_share
from texproj.register.structure.view import FINE, Observation, StructureView
from texproj.render import GBuffer, Render

GLANCE_PX = 256
"""Longer side of the picture that tells what of the mesh is in view."""
LEAST_STRENGTH = 0.02
"""Mean squared length of a rendering's orientation field below which a patch holds no edge."""
LEAST_PATCHES = 100
"""Patches with edges in rendering and photo below which nothing is concluded."""
FOUND, CHANCE = 0.3, 0.04
"""Share of the patches in place from which on a camera is right, and up to which it may be
anywhere: chance gives 0.02, at half the size 0.04; right cameras of a painted object whose edges
the mesh does not have 0.07."""


@dataclass(frozen=True)
class Glance:
    """Shares: of the picture that shows the mesh, and of that what is seen from behind."""

    in_picture: float
    from_behind: float


@dataclass(frozen=True)
class StructureLook:
    """patches: how many had edges to compare; fine, middle: share of them in place at the working
    size and at half of it.
    """

    patches: int
    fine: float
    middle: float

    @property
    def tells(self) -> bool:
        return self.patches >= LEAST_PATCHES

    @property
    def agrees(self) -> bool:
        return self.tells and self.fine >= FOUND

    @property
    def contradicts(self) -> bool:
        return self.tells and self.fine <= CHANCE and self.middle <= 2 * CHANCE


def glance(camera: Camera, render: Render) -> Glance:
    """What of the mesh is in the picture."""
    images = render(camera.reduced(GLANCE_PX))
    solid = np.isfinite(images.require("depth"))
    if not solid.any() or images.front is None:
        return Glance(float(solid.mean()), 0.0)
    return Glance(float(solid.mean()), float((solid & ~images.front).sum() / solid.sum()))


def look(photo: Photo, camera: Camera, render: Render, working_px: int) -> StructureLook:
    """The mesh's edges in the photo, sought where the camera (full size) says they are."""
    view = StructureView.of(photo, _with_open_sky(render), working_px, camera)
    fine, middle = view.observe(camera, LAST), view.observe(camera, CHECK)
    told = int((_telling(fine) & _on_texture(photo, fine, view)).sum())
    return StructureLook(told, found_share(fine), found_share(middle))


def _telling(seen: Observation) -> np.ndarray:
    return seen.matches.strength >= LEAST_STRENGTH


def _on_texture(photo: Photo, seen: Observation, view: StructureView) -> np.ndarray:
    """(patches,) whether the photo shows anything there."""
    _, part = view.window.cut(photo)
    height, width = view.fields[FINE].shape
    shown = textured(part.gray()).astype(np.uint8)
    column, row = seen.grid_px.astype(int).T
    found: np.ndarray = cv2.resize(shown, (width, height))[row, column] > 0
    return found


def _with_open_sky(render: Render) -> Render:
    """Renderings without ambient occlusion: it takes seconds to make and is not needed here."""

    def bare(camera: Camera) -> GBuffer:
        images = render(camera)
        return replace(images, ao=np.ones_like(images.require("depth")))

    return bare
