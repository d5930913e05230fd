"""The settings of every stage: the one home of each default, its bounds and its help text.

Command-line flags and project.toml are made from these classes; a flag overrides project.toml,
which overrides the default here.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any, Literal, TypeVar

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from texproj.errors import UsageError, nearest_name

STRICT = ConfigDict(extra="forbid", use_attribute_docstrings=True)
T = TypeVar("T")

Positive = Annotated[float, Field(gt=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]


@dataclass(frozen=True, config=STRICT)
class RenderOptions:
    """How images of the mesh are made."""

    renderer: Literal["auto", "gl", "cpu"] = "auto"
    """OpenGL, the ray caster on the processor, or whichever works (GL first)."""


@dataclass(frozen=True, config=STRICT)
class RegisterOptions:
    """How the cameras of the photos are found."""

    method: Literal[
        "auto", "points", "mutual-information", "silhouette", "structure", "features"
    ] = "auto"
    """Auto uses what the project has: picks, an approximate camera, a mask, other photos."""


@dataclass(frozen=True, config=STRICT)
class ColorOptions:
    """How photos are projected onto the surface and blended."""

    to: Literal["vertices", "texture", "patches"] = "texture"
    """One color per vertex of the mesh, a texture blended from all photos, or a texture of patches
    cut from single photos."""

    depth_scale: Annotated[float, Field(gt=0, le=1)] = 0.5
    """Size of the depth image that decides what a photo sees, as a part of the photo's size."""

    min_cos_angle: Annotated[float, Field(gt=0, lt=1)] = 0.05
    """Surface turned away from the camera further than this cosine gets no color from it."""

    angle_power: Annotated[float, Field(ge=0)] = 1.0
    """How strongly a frontal view is preferred; 0 = not at all."""

    density_power: Annotated[float, Field(ge=0)] = 1.0
    """How strongly a view with more pixels on the surface is preferred; 0 = not at all."""

    border_feather: Annotated[float, Field(ge=0, le=1)] = 0.03
    """Width of the ramp at a photo's border, as a part of its diagonal."""

    silhouette_feather: Annotated[float, Field(ge=0, le=1)] = 0.005
    """Width of the ramp beside depth discontinuities, as a part of the photo's diagonal."""

    mask_erode: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """How far masks are grown before they count, as a part of the photo's diagonal."""

    mask_feather: Annotated[float, Field(ge=0, le=1)] = 0.003
    """Width of the ramp beside a mask, as a part of the photo's diagonal."""

    clipped_weight: Fraction = 0.2
    """Weight of samples where the photo is over-exposed; 1 = as good as any."""

    dark_weight: Fraction = 0.2
    """Weight of samples where the photo is hardly above black; 1 = as good as any."""

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

    robust_scale: Positive = 0.1
    """Difference from the other photos (square root of linear light, 1 = white) at which a sample
    counts half."""

    preference: Annotated[float, Field(ge=0, le=8)] = 0.85
    """How strongly the best of the photos that agree is preferred: the power of its weight. Not
    used by the blend "mean", where it is 1."""

    texels_per_pixel: Annotated[float, Field(gt=0, le=4)] = 1.0
    """Texels along a line per pixel of the photo that shows the surface best."""

    checker: Annotated[str, Field(min_length=1)] | None = None
    """Photo of a 24-patch color chart that makes the colors absolute: a path in the project."""

    bits: Literal[8, 16] = 8
    """Bits per channel of the obj's images (png or tiff). Other files hold 8, but a glb's vertex
    colors are in floating point."""


@dataclass(frozen=True, config=STRICT)
class OutputOptions:
    """Which files are written to out/, and what is in them."""

    models: tuple[Literal["auto", "glb", "obj", "ply"], ...] = ("auto",)
    """Kinds of model files: auto = glb and obj with a texture, ply with vertex colors (which a glb
    can hold too)."""

    image: Literal["png", "jpeg", "webp", "tiff", "ktx2"] = "png"
    """Format of the texture's images. tiff is for the obj, ktx2 (made by the program basisu) for
    the glb: the other model gets png."""

    quality: Annotated[int, Field(ge=1, le=100)] = 95
    """Of jpeg and webp; 100 = webp without loss."""

    normals: bool = True
    """Write a normal for each vertex."""

    unlit: bool = True
    """A glb shows the colors as photographed, without lights of the viewer's own."""


@dataclass(frozen=True, config=STRICT)
class UnwrapOptions:
    """How the surface is cut into charts and laid out on the pages of the texture."""

    page_size: Annotated[int, Field(ge=16, le=32768)] = 8192
    """Largest width and height of a page, texels."""
    max_pages: Annotated[int, Field(ge=1, le=256)] = 4
    """Most pages; the resolution is lowered where that many are not enough."""
    padding_px: Annotated[int, Field(ge=1, le=64)] = 4
    """Empty texels between two charts, filled later so that filtering does not mix them."""
    flatness: Annotated[float, Field(gt=0.5, lt=1)] = 0.93
    """How flat a chart must be: the least length of its mean normal. Lower: fewer charts, more
    stretch."""
    steepest_deg: Annotated[float, Field(gt=30, lt=85)] = 75.0
    """Largest angle between a face and the plane of its chart."""


@dataclass(frozen=True, config=STRICT)
class PatchOptions:
    """How the surface is divided among the photos for `--to patches`."""

    seam_px: Annotated[float, Field(ge=0, le=1000)] = 8.0
    """What a seam costs: as much as a strip of so many pixels in a photo that is plainly wrong;
    half of it where all photos agree, several times where they do not."""

    resolution: Annotated[float, Field(ge=0, le=10)] = 0.02
    """What it costs to halve the number of pixels on the surface; 1 = as much as a wrong photo."""

    margin: Annotated[float, Field(ge=0, le=10)] = 0.3
    """What it costs to use the very border of a photo, or the edge of something in front."""

    consensus_scale: Positive = 0.03
    """Difference from what all photos agree on (square root of linear light, 1 = white) that costs
    half as much as a wrong photo."""

    outlier: Positive = 3.0
    """Beyond so many times that difference a photo is not used, if at least three others agree."""

    candidates: Annotated[int, Field(ge=1, le=64)] = 10
    """Most photos that a face can choose from."""

    smallest_px: Annotated[float, Field(ge=0)] = 200.0
    """Patches of fewer pixels join their neighbors where those may show them."""

    strip_px: Annotated[float, Field(gt=0, le=1000)] = 16.0
    """Width on either side of a seam in which the two photos fade into each other."""

    level_px: Annotated[float, Field(ge=0, le=10000)] = 20.0
    """Distance over which colors are brought to what all photos agree on; 0 = not at all."""


@dataclass(frozen=True, config=STRICT)
class PointsOptions:
    """How a camera is solved from picked points."""

    solve: tuple[Literal["auto", "pose", "focal", "principal-point", "k1", "k2"], ...] = ("auto",)
    """What to solve besides the pose: auto = what is uncertain and what the picks contradict."""

    focal: Literal["auto", "known", "approximate", "unknown"] = "auto"
    """How far to trust the focal length at hand: auto = known if it comes from cameras.json,
    unless the picks contradict it; approximate if from EXIF; unknown if there is none."""

    pick_sigma_percent: Positive = 0.07
    """Usual noise of a pick, percent of the photo's longer side; corrected by the residuals."""

    max_error_percent: Positive = 0.3
    """Refuse a camera whose expected error on the surface is larger, percent of the longer side."""

    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the random sampling; the same seed gives the same camera."""


@dataclass(frozen=True, config=STRICT)
class StructureOptions:
    """How a camera is found by matching the mesh's structure, and when it is believed."""

    working_px: Annotated[int, Field(ge=128, le=4096)] = 768
    """Longer side of the reduced photo that is matched, pixels."""

    rolls_deg: tuple[float, ...] = (-14.0, -7.0, 0.0, 7.0, 14.0)
    """Turns about the line of sight that are tried around the start, degrees."""

    scales: tuple[Positive, ...] = (0.74, 0.86, 1.0, 1.16, 1.35)
    """Enlargements that are tried around the start."""

    starts: Annotated[int, Field(ge=0, le=100)] = 5
    """How many of the best turned, enlarged and shifted starts are followed up."""

    focal_sigma: Positive = 0.05
    """How far to trust the start's focal length: relative standard deviation."""

    k1_sigma: Annotated[float, Field(ge=0)] = 0.1
    """How far to trust the start's radial distortion k1: standard deviation; 0 = entirely. It is
    changed only where the photo leaves no doubt."""

    sure_support: Fraction = 0.75
    """Share of patches found in place at which no further start is tried."""

    confirmed_support: Fraction = 0.45
    """The same where two starts have led to the same place."""

    wider: bool = True
    """If the search around the start fails, search from other positions too."""

    min_support: Fraction = 0.33
    """Share of patches found in place, at half the working size, below which a camera is
    refused ..."""

    min_agreement: Fraction = 0.3
    """... unless that share at the working size is at least this."""

    min_coverage: Fraction = 0.4
    """Share of the picture that must agree, counted in cells where the mesh is."""

    far: Positive = 0.2
    """Image motion from the start, as a share of the width, from which on more is asked ..."""

    far_support: Fraction = 0.55
    """... namely this share of patches in place: what looks alike elsewhere has less."""

    max_error_percent: Positive = 0.5
    """Refuse a camera whose expected error on the surface is larger, percent of the longer side."""


MapName = Literal[
    "normal-x",
    "normal-y",
    "normal-z",
    "ao",
    "normal",
    "combined",
    "reflection",
    "reflection-combined",
    "silhouette",
]
"""What of the bare mesh is compared with a photo by mutual information."""


@dataclass(frozen=True, config=STRICT)
class MutualInformationOptions:
    """How a camera is moved until the rendered mesh tells most about the photo."""

    maps: tuple[MapName, ...] = ("normal-x", "normal-y", "ao", "silhouette")
    """Renderings that are compared; their information is added up. Normals (camera axes), ambient
    occlusion, both blended (combined), mirror directions, and inside against outside."""

    measure: Literal["mutual-information", "normalized"] = "mutual-information"
    """The plain measure, or the one that is divided by the joint entropy."""

    gradients: bool = False
    """Compare the strengths of gradients instead of the values."""

    bins: Annotated[int, Field(ge=4, le=256)] = 32
    """Steps into which gray and rendered values are divided."""

    working_px: Annotated[int, Field(ge=128, le=4096)] = 512
    """Longer side of the reduced photo at the finest level, pixels."""

    focal: bool = False
    """Solve the focal length too; the distance follows it, so that the size stays."""

    pick_sigma_percent: Positive = 0.07
    """Noise of picks, percent of the photo's longer side, where there are any: it decides how
    much they count beside the mutual information."""

    max_error_percent: Positive = 0.4
    """Refuse a camera whose expected error is larger, percent of the photo's width."""


@dataclass(frozen=True, config=STRICT)
class SilhouetteOptions:
    """How a camera is found from the object's outline, without any start if need be."""

    views: Annotated[int, Field(ge=20, le=5000)] = 500
    """Directions from which the mesh's outline is compared where there is no start."""

    followed: Annotated[int, Field(ge=1, le=200)] = 24
    """How many of the likeliest views are fitted coarsely."""

    hypotheses: Annotated[int, Field(ge=1, le=20)] = 5
    """How many of those, if they differ, are fitted finely and told apart by what is inside."""

    working_px: Annotated[int, Field(ge=64, le=2048)] = 320
    """Longer side of the reduced photo at the finest level, pixels."""

    max_xor: Fraction = 0.06
    """Area between the two outlines, as a share of the object's, above which a camera is
    refused."""

    rival: Annotated[float, Field(ge=1)] = 1.5
    """A camera from elsewhere is a rival if its area is smaller than this many times the best."""

    max_error_percent: Positive = 1.0
    """Refuse a camera whose expected error is larger, percent of the photo's width."""


@dataclass(frozen=True, config=STRICT)
class PreviewOptions:
    """How the web page is served."""

    host: Annotated[str, Field(min_length=1)] = "127.0.0.1"
    """Address to listen on. Beyond this machine a token is needed, which is printed."""

    port: Annotated[int, Field(ge=0, le=65535)] = 8765
    """Port to listen on; 0 = any free one."""

    light_faces: Annotated[int, Field(ge=1000)] = 30_000
    """Meshes of more faces are shown with about so many while the view moves."""

    max_request_bytes: Annotated[int, Field(ge=1000)] = 1_000_000
    """Longest request that is read."""


@dataclass(frozen=True, config=STRICT)
class DemoOptions:
    """A synthetic project with known truth."""

    object: Literal["stele", "capital"] = "stele"
    """What is carved."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Another number, another piece, other photos; the same number gives the same bytes."""
    photos: Annotated[int, Field(ge=1, le=99)] = 9
    """Number of photos; every second has picked points, the others have a rough camera."""
    long_side: Annotated[int, Field(ge=64, le=6000)] = 960
    """Longer side of the photos in pixels."""
    faces: Annotated[int, Field(ge=500, le=5_000_000)] = 60_000
    """Triangles of the scan, about."""
    carved_faces: Annotated[int, Field(ge=500, le=5_000_000)] = 300_000
    """Triangles of the true piece that is photographed, about."""
    scan_noise_mm: Annotated[float, Field(ge=0, le=20)] = 0.4
    """Standard deviation of the scan's noise along the surface normal."""
    start_error_px: Annotated[float, Field(ge=0, le=500)] = 40.0
    """Mean displacement of the piece in the rough cameras."""
    calibrated: bool = True
    """The rough cameras have the true lens; else only the focal length that EXIF tells."""
    pick_sigma_px: Annotated[float, Field(ge=0, le=50)] = 1.0
    """Standard deviation of the picks, along each axis."""
    gloss: Annotated[float, Field(ge=0, le=5)] = 0.5
    """Strength of the highlight; 0 is matte, 1 polished."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the piece stands in the world; large values imitate survey coordinates."""


@dataclass(frozen=True, config=STRICT)
class RefineOptions:
    """How the cameras of all photos are brought to agree with each other on the surface."""

    enabled: bool = True
    """Whether `run` refines; `texproj refine` always does."""

    working_px: Annotated[int, Field(ge=256, le=8192)] = 768
    """Longer side of the reduced photos that are compared, pixels; twice that at the end."""

    partners: Annotated[int, Field(ge=1, le=50)] = 6
    """With how many others each photo is compared."""

    rounds: Annotated[int, Field(ge=0, le=100)] = 8
    """Most rounds at the working size; it stops earlier when the cameras no longer move."""

    fine_rounds: Annotated[int, Field(ge=0, le=100)] = 2
    """Most rounds at twice the working size."""

    focal_sigma: Positive = 0.02
    """How far to trust the focal length that the photos of one lens have found on average:
    relative standard deviation."""

    least_support: Fraction = 0.15
    """A photo is thrown out if no partner confirms at least this share of its patches."""


def options_from(cls: type[T], values: dict[str, Any], where: str) -> T:
    """`cls` with `values` over its defaults.

    Raises UsageError that names `where`, the key and the nearest known key or the bound.
    """
    known = [f.name for f in fields(cls)]  # type: ignore[arg-type]
    for key in values:
        if key not in known:
            raise UsageError(f"{where}: unknown key {key!r}{nearest_name(key, known)}")
    try:
        return TypeAdapter(cls).validate_python(values)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        message = f"{where}: {key} = {first['input']!r}: {first['msg'].lower()}"
        raise UsageError(message) from None
