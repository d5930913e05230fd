"""Small displacements of photos on the surface, found against what all of them show together.

After Dellepiane, Marroquim, Callieri, Cignoni, Scopigno, "Flow-based local optimization for
image-to-geometry projection", IEEE TVCG 2012, and Zhou and Koltun, "Color map optimization for 3D
reconstruction with consumer depth cameras", SIGGRAPH 2014; the rules of what is sure are ours.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.alignment.flow import sure_flow
from texproj.color.result import Texture, textured_mesh
from texproj.color.sampling.part import Unusable
from texproj.color.sampling.photo_set import PhotoSet
from texproj.color.sampling.view import PhotoView
from texproj.mesh import Mesh, TexturedMesh
from texproj.options import ColorOptions
from texproj.photo import Photo
from texproj.render import Renderer, render_model

WORKING_PX = 1600
"""Longest side of the pictures that are compared: displacements of a few pixels of the photo are
still one of these, and the noise is less."""

LARGEST = 0.0025
"""Displacement in parts of the picture's diagonal beyond which it is another thing that is seen,
or a camera to be refined; but never less than `LEAST_PX`."""

LEAST_PX = 4.0
"""Pixels of the working size that a photo may always be off."""

ROUGH = 0.5
"""Texels per pixel of the first coloring, against that of the result."""

KEPT = 4
"""Pixels of the compared picture per pixel of the displacement that is kept: it is smooth."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """Where a photo shows the surface, against where its camera says.

    shift: (h, w, 2) float32 pixels of the decoded photo, over the whole picture, 0 where not sure;
    median_px, largest_px: its length where sure; sure: that part of the surface's pixels.
    """

    shift: Floats
    median_px: float
    largest_px: float
    sure: float


def rough(options: ColorOptions) -> ColorOptions:
    """The options of the coloring against which photos are compared."""
    density = options.texels_per_pixel * ROUGH
    return replace(options, align=False, blend="robust", texels_per_pixel=density, bits=8)


def alignments(
    mesh: Mesh,
    texture: Texture,
    photos: PhotoSet,
    renderer: Renderer,
) -> tuple[Alignment | Unusable, ...]:
    """The displacements of all photos against a texture made of them. Every photo is read once
    more.
    """
    model = textured_mesh(mesh, replace(texture, kept=None), normals=False)

    def one(number: int) -> Alignment | Unusable:
        photo = photos.photo(number)
        if isinstance(photo, Unusable):
            return photo
        return alignment(photo, photos.cameras[number], model, renderer)

    return tuple(one(number) for number in range(len(photos)))


def alignment(photo: Photo, camera: Camera, model: TexturedMesh, renderer: Renderer) -> Alignment:
    """The displacement of one photo against a model. camera: of the full-size photo."""
    small = photo.reduced(WORKING_PX)
    size = (small.width, small.height)
    render = render_model(renderer, model, camera.resized(*size), samples=1)
    solid = render[..., 3] == 255
    if small.mask is not None:
        solid &= small.mask > 0
    there = light_of(render[..., :3])
    here = light_of(small.pixels)
    largest = max(LEAST_PX, LARGEST * float(np.hypot(*size)))
    shift, sure = sure_flow(here, np.where(solid, there, here), solid, largest)
    scale = np.array([photo.width / size[0], photo.height / size[1]], np.float32)
    return _described(shift * scale, sure, solid)


def light_of(pixels: NDArray[Any]) -> Floats:
    """(h, w) float32 luma of sRGB uint8 or the square root of linear light."""
    if pixels.dtype == np.uint8:
        return cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY).astype(np.float32) / np.float32(255)
    linear = cv2.cvtColor(pixels.astype(np.float32), cv2.COLOR_RGB2GRAY)
    return np.sqrt(np.clip(linear, 0, 1))


def _described(shift: Floats, sure: NDArray[np.bool_], solid: NDArray[np.bool_]) -> Alignment:
    length = np.linalg.norm(shift[sure], axis=1) if sure.any() else np.zeros(1)
    share = float(sure.sum() / max(float(solid.sum()), 1.0))
    size = tuple(max(2, -(-side // KEPT)) for side in shift.shape[1::-1])
    kept = cv2.resize(shift, size, interpolation=cv2.INTER_AREA)
    return Alignment(kept, float(np.median(length)), float(length.max()), share)


def displaced(
    views: Iterable[PhotoView | Unusable], found: Sequence[Alignment | Unusable]
) -> Iterator[PhotoView | Unusable]:
    """The views with their displacements, if any were looked for."""
    for number, view in enumerate(views):
        one = found[number] if found else None
        if isinstance(view, PhotoView) and isinstance(one, Alignment):
            yield replace(view, shift=one.shift)
        else:
            yield view
        del view  # before the next one is made


def failures(found: Iterable[Alignment | Unusable]) -> list[Unusable]:
    """The photos that could not be read when they were to be aligned."""
    return [one for one in found if isinstance(one, Unusable)]


def per_alignment(
    names: Sequence[str], found: Sequence[Alignment | Unusable]
) -> dict[str, list[dict[str, Any]]]:
    """For the report: of each photo the median and the largest displacement, pixels, where it is
    sure, and the part of the surface in the picture where it is; nothing if none were looked for.
    """
    rows = [
        {"file": n, "median_px": one.median_px, "largest_px": one.largest_px, "sure": one.sure}
        for n, one in zip(names, found, strict=bool(found))
        if isinstance(one, Alignment)
    ]
    return {"alignment": rows} if found else {}
