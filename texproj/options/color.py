"""How the surface is colored and what is written."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from texproj.options.base import EXPERT, STRICT, Fraction, Positive


@dataclass(frozen=True, config=STRICT)
class ColorOptions:
    """How photos are projected onto the surface and blended."""

    to: Literal["vertices", "texture", "patches"] = "texture"
    """One color per vertex of the mesh, a texture blended from all photos, or a texture of patches
    cut from single photos."""

    angle_power: Annotated[float, Field(ge=0), EXPERT] = 1.0
    """How strongly a frontal view is preferred; 0 = not at all."""

    density_power: Annotated[float, Field(ge=0), EXPERT] = 1.0
    """How strongly a view with more pixels on the surface is preferred; 0 = not at all."""

    mask_erode: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """How far masks are grown before they count, as a part of the photo's diagonal."""

    clipped_weight: Annotated[Fraction, EXPERT] = 0.2
    """Weight of samples where the photo is over-exposed; 1 = as good as any."""

    occluders: bool = True
    """Leave out what stands in front of the piece in single photos: found where the other photos
    contradict, cut out whole, kept as a mask in work/occluders/ that can be edited."""

    focus_power: Annotated[float, Field(ge=0, le=8)] = 2.0
    """How strongly blurred parts of photos are distrusted: the power of their energy of fine detail
    against that of the other photos; 0 = not looked at. By "multi-band" only in their detail."""

    highlight: Annotated[float, Field(ge=0, le=100)] = 0.0
    """How strongly a photo is distrusted where it shows a highlight: brighter than most others, by
    light without the surface's color; 0 = not at all. For glossy things."""

    gains: bool = True
    """Correct each photo's exposure and white balance by what the others show there."""

    vignetting: Literal["auto", "on", "off"] = "auto"
    """Correct the light that a lens loses towards the corners. "on": wherever the photos tell it
    surely; "auto": where they also agree visibly better with each other then."""

    align: bool = False
    """Shift parts of photos by the few pixels that they are off on the surface, found against a
    first coloring: where it is sure, smoothly. Every photo is read three times and the mesh colored
    twice. Not for patches."""

    blend: Literal["multi-band", "robust", "mean", "best"] = "multi-band"
    """How the photos of a point become one color. "robust": the average of those that agree;
    "multi-band": the same, and what averaging takes from fine detail is given back as far as the
    photos agree on it; "mean": the plain weighted average; "best": one photo, the best of those
    that agree."""

    robust_scale: Annotated[Positive, EXPERT] = 0.1
    """Difference from the other photos (square root of linear light, 1 = white) at which a sample
    counts half."""

    preference: Annotated[Annotated[float, Field(ge=0, le=8)] | Literal["auto"], EXPERT] = "auto"
    """How strongly the best of the photos that agree is preferred: the power of its weight. "auto":
    that with which each photo is predicted best from the others. Not used by the blend "mean",
    where it is 1."""

    texels_per_pixel: Annotated[float, Field(gt=0, le=4)] = 1.0
    """Texels along a line per pixel of the photo that shows the surface best."""

    fill: Annotated[Literal["around", "texture"], EXPERT] = "around"
    """What a texture shows where no photo sees: colors from around it, or the texture that the mesh
    file brings."""

    checker: Annotated[str, Field(min_length=1)] | None = None
    """Photo of a 24-patch color chart that makes the colors absolute: a path in the project."""

    bits: Literal[8, 16] = 8
    """Bits per channel of the obj's images (png, tiff, exr). Other files hold 8, but a glb's vertex
    colors are in floating point."""


@dataclass(frozen=True, config=STRICT)
class UnwrapOptions:
    """How the surface is cut into charts and laid out on the pages of the texture."""

    keep: Literal["auto", "on", "off"] = "auto"
    """Texture coordinates that the mesh brings are the texture's, with materials,
    tiles and names. "auto": where every face has a place of its own; "on": shared places are
    painted once, and it is an error to have none; "off": never."""

    page_size: Annotated[int, Field(ge=16, le=32768)] = 8192
    """Largest width and height of a page, texels."""
    max_pages: Annotated[int, Field(ge=1, le=256)] = 4
    """Most pages; the resolution is lowered where that many are not enough."""
    padding_px: Annotated[int, Field(ge=1, le=64)] = 4
    """Empty texels between two charts, filled later so that filtering does not mix them."""


@dataclass(frozen=True, config=STRICT)
class PatchOptions:
    """How the surface is divided among the photos for `--to patches`."""

    seam_px: Annotated[float, Field(ge=0, le=1000)] = 8.0
    """What a seam costs: as much as a strip of so many pixels in a photo that is plainly wrong;
    half of it where all photos agree, several times where they do not."""

    resolution: Annotated[float, Field(ge=0, le=10), EXPERT] = 0.02
    """What it costs to halve the number of pixels on the surface; 1 = as much as a wrong photo."""

    smallest_px: Annotated[float, Field(ge=0), EXPERT] = 200.0
    """Patches of fewer pixels join their neighbors where those may show them."""

    strip_px: Annotated[float, Field(gt=0, le=1000), EXPERT] = 16.0
    """Width on either side of a seam in which the two photos fade into each other."""

    level_px: Annotated[float, Field(ge=0, le=10000)] = 20.0
    """Distance over which colors are brought to what all photos agree on; 0 = not at all."""


@dataclass(frozen=True, config=STRICT)
class OutputOptions:
    """Which files are written to out/, and what is in them."""

    models: tuple[Literal["auto", "glb", "obj", "ply", "usdz"], ...] = ("auto",)
    """Kinds of model files: auto = glb and obj with a texture, ply with vertex colors (which a glb
    can hold too). usdz holds a texture as png or jpeg, for Apple's viewers and USD."""

    faces: tuple[Annotated[int, Field(ge=4)], ...] = ()
    """A textured model of so many triangles, with the colors and a normal map of the full mesh; of
    several numbers the first is the model, the others are levels of detail (model_lod1, ...). The
    normal map is beside the obj, and in a glb with `unlit = false`."""

    image: Literal["png", "jpeg", "webp", "tiff", "exr", "ktx2"] = "png"
    """Format of the texture's images. tiff and exr (linear light, half precision) are for the obj,
    ktx2 (made by the program basisu) for the glb: the other model gets png."""

    quality: Annotated[int, Field(ge=1, le=100)] = 95
    """Of jpeg and webp; 100 = webp without loss."""

    compression: Annotated[Literal["none", "draco"], EXPERT] = "none"
    """Of a textured glb's geometry. draco: a tenth of the bytes, positions off by less than a
    hundredth of an edge; viewers without Draco show nothing."""

    normals: bool = True
    """Write a normal for each vertex."""

    up: Literal["auto", "x", "-x", "y", "-y", "z", "-z"] = "y"
    """The scan's upward axis, by which a glb is turned to stand upright (glTF has y upwards): a
    node turns it, coordinates stay the scan's, in obj and ply too. auto: upward in the photos. An
    axis named here tells photos without a start which way up they belong, too."""

    unit: Annotated[Literal["auto", "m", "cm", "mm"], EXPERT] = "auto"
    """The scan's unit, by which the same node scales a glb to metres; auto = as it is."""

    unlit: bool = True
    """A glb or usdz shows the colors as photographed, without lights of the viewer's own."""
