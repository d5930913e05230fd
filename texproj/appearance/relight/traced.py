"""The same pictures by a path tracer of other hands: all bounces, soft shadows, every mirror sharp.

Mitsuba 3, W. Jakob et al., 2022. It is no dependency: 60 MB that only a reference needs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from math import ceil
from typing import Any

import cv2
import numpy as np

from texproj.appearance.relight.environment import Environment
from texproj.appearance.relight.illumination import Illumination
from texproj.appearance.relight.lit_surface import LitSurface
from texproj.appearance.relight.thin_lens import Lens, darkened
from texproj.arrays import Floats
from texproj.camera import Camera, Intrinsics
from texproj.errors import UsageError
from texproj.mesh import TexturedMesh
from texproj.render.lens import ideal_grid, pinhole_cover

SAMPLES = 64
"""Paths per pixel: noise of a hundredth where light comes straight."""

DEPTH = 8
"""Longest path: what bounces more often is a thousandth of the light."""

VARIANT = "scalar_rgb"
"""Runs everywhere, on all cores; the vectorized ones want LLVM or a graphics card."""


def check_tracer() -> None:
    """Raise UsageError where there is no path tracer."""
    if find_spec("mitsuba") is None:
        raise UsageError("--traced needs Mitsuba, which is not installed: pip install mitsuba")


def traced_pictures(
    surface: LitSurface,
    light: Illumination,
    cameras: Iterable[Camera],
    lens: Lens | None = None,
    samples: int = SAMPLES,
) -> Iterator[Floats]:
    """For each camera (h, w, 4) float32: linear luminance times alpha, and alpha. Raises UsageError
    where Mitsuba is not installed.
    """
    check_tracer()
    import mitsuba as mi  # noqa: PLC0415 - slow to load, and an extra

    if mi.variant() is None:
        mi.set_variant(VARIANT)
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": DEPTH, "hide_emitters": True},
        **_shapes(mi, surface),
        **_lights(mi, light),
    })  # fmt: skip
    for number, camera in enumerate(cameras):
        cover = _cover(camera)
        film = mi.load_dict(_sensor(mi, cover, lens))
        made = mi.render(scene, sensor=film, spp=samples, seed=number)
        layers = _bent(np.nan_to_num(np.array(made, np.float32)), cover, camera)
        yield layers if lens is None else darkened(layers, camera)


def _cover(camera: Camera) -> Camera:
    """The camera that is traced: without distortion, with square pixels and its axis in the middle,
    since Mitsuba's thin lens knows no other.
    """
    cover = pinhole_cover(camera)
    k = cover.intrinsics
    focal = max(k.fx, k.fy)
    width, height = (
        ceil(2 * focal / own * max(middle, size - middle) - 1e-6)
        for own, middle, size in ((k.fx, k.cx, k.width), (k.fy, k.cy, k.height))
    )
    return replace(cover, intrinsics=Intrinsics(width, height, focal, focal, width / 2, height / 2))


def _bent(layers: Floats, cover: Camera, camera: Camera) -> Floats:
    """(h, w, 4) the picture of a camera from that of its cover; nothing where the lens ends."""
    k = cover.intrinsics
    if k == camera.intrinsics.pinhole and not camera.intrinsics.distorted:
        return layers
    at = ideal_grid(camera.intrinsics) * np.array((k.fx, k.fy), np.float32)
    at = np.nan_to_num(at + np.array((k.cx - 0.5, k.cy - 0.5), np.float32), nan=-2.0)
    out = cv2.remap(layers, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(out, np.float32)


def _sensor(mi: Any, camera: Camera, lens: Lens | None) -> dict[str, Any]:
    """Mitsuba's camera looks along +z with x to the left and y up."""
    to_world = np.eye(4)
    to_world[:3, :3] = camera.pose.R.T @ np.diag([-1.0, -1, 1])
    to_world[:3, 3] = camera.center
    k = camera.intrinsics
    out: dict[str, Any] = {
        "type": "perspective" if lens is None else "thinlens",
        "fov": float(np.degrees(2 * np.arctan(camera.width / 2 / k.fx))), "fov_axis": "x",
        "to_world": mi.ScalarTransform4f(to_world),
        "near_clip": 1e-4 * float(np.linalg.norm(camera.pose.t)) + 1e-9,
        "far_clip": 1e4 * float(np.linalg.norm(camera.pose.t)) + 1e-3,
        "film": {
            "type": "hdrfilm", "width": camera.width, "height": camera.height,
            "rfilter": {"type": "box"}, "pixel_format": "rgba", "component_format": "float32",
        },
        "sampler": {"type": "independent"},
    }  # fmt: skip
    if lens is not None:
        out |= {"aperture_radius": lens.radius, "focus_distance": lens.focus}
    return out


def _lights(mi: Any, light: Illumination) -> dict[str, Any]:
    """All of them; lux and candela as they are."""
    out: dict[str, Any] = {}
    for number, sun in enumerate(light.suns):
        out[f"sun_{number}"] = {
            "type": "directional", "direction": (-sun.toward).tolist(),
            "irradiance": {"type": "rgb", "value": sun.illuminance.tolist()},
        }  # fmt: skip
    for number, lamp in enumerate(light.lamps):
        out[f"lamp_{number}"] = {
            "type": "point", "position": lamp.place.tolist(),
            "intensity": {"type": "rgb", "value": lamp.intensity.tolist()},
        }  # fmt: skip
    if light.environment is not None:
        out["sky"] = _sky(mi, light.environment)
    return out


def _sky(mi: Any, sky: Environment) -> dict[str, Any]:
    """Mitsuba's picture has its top row at +y and its middle at +z."""
    to_world = np.eye(4)
    to_world[:3, :3] = np.stack([np.cross(sky.up, sky.ahead), sky.up, sky.ahead], axis=1)
    picture = mi.Bitmap(np.ascontiguousarray(sky.radiance, np.float32))
    return {
        "type": "envmap", "bitmap": picture, "to_world": mi.ScalarTransform4f(to_world),
    }  # fmt: skip


def _shapes(mi: Any, surface: LitSurface) -> dict[str, Any]:
    """One shape a page, and one of the faces without any."""
    model = surface.model
    if not isinstance(model, TexturedMesh):
        base = {"type": "mesh_attribute", "name": "vertex_color"}
        return {"piece": _shape(mi, surface, np.ones(len(model.faces), bool), _bsdf(base))}
    out = {}
    for page in np.unique(model.page_of_face):
        rows = model.page_of_face == page
        if page < 0:
            bsdf = _bsdf({"type": "mesh_attribute", "name": "vertex_color"})
        else:
            bsdf = _bsdf(_image(mi, model.pages[page], raw=False))
            if model.normal_map is not None:
                bump = _image(mi, model.normal_map.pages[page], raw=True)
                bsdf = {"type": "normalmap", "normalmap": bump, "bsdf": bsdf}
        out[f"piece_{page + 1}"] = _shape(mi, surface, rows, bsdf)
    return out


def _bsdf(base: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "principled", "specular": 0.5, "base_color": base,
        "roughness": {"type": "mesh_attribute", "name": "vertex_roughness"},
        "metallic": {"type": "mesh_attribute", "name": "vertex_metallic"},
    }  # fmt: skip


def _image(mi: Any, page: Any, raw: bool) -> dict[str, Any]:
    pixels = page[..., :3]
    if pixels.dtype != np.uint8:
        pixels = np.round(pixels / 257).astype(np.uint8)
    return {
        "type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(pixels)), "raw": raw,
        "wrap_mode": "clamp",
    }  # fmt: skip


def _shape(mi: Any, surface: LitSurface, rows: Any, bsdf: dict[str, Any]) -> Any:
    """Some faces (F,) of the model, with the vertices that they use; one that lies at several
    places of the texture is several.
    """
    model = surface.model
    vertex, texel = model.faces[rows].ravel().astype(np.int64), np.zeros(3 * rows.sum(), np.int64)
    if isinstance(model, TexturedMesh):
        texel = model.uv_faces[rows].ravel().astype(np.int64)
    pairs, faces = np.unique(vertex + len(model.vertices) * texel, return_inverse=True)
    texel, used = np.divmod(pairs, len(model.vertices))
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "twosided", "inner": bsdf})
    shape = mi.Mesh(
        "piece", len(used), int(rows.sum()), props=properties, has_vertex_normals=True,
        has_vertex_texcoords=isinstance(model, TexturedMesh),
    )  # fmt: skip
    values = {
        "color": surface.base_of_vertex, "roughness": surface.roughness,
        "metallic": surface.metallic,
    }  # fmt: skip
    for name, value in values.items():
        shape.add_attribute(f"vertex_{name}", value.size // len(value), value[used].ravel())
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = model.vertices[used].astype(np.float32).ravel()
    parameters["vertex_normals"] = surface.normals[used].astype(np.float32).ravel()
    parameters["faces"] = faces.astype(np.uint32).ravel()
    if isinstance(model, TexturedMesh):
        down = model.uv[texel] * (1, -1) + (0, 1)
        parameters["vertex_texcoords"] = down.astype(np.float32).ravel()
    parameters.update()
    return shape
