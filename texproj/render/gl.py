"""The OpenGL renderer: a context without a window, and a mesh that lives on it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.mesh import Mesh
from texproj.render.blocks import camera_block, lens_block
from texproj.render.gbuffer import GBuffer, checked_channels
from texproj.render.lens import bend, ideal_grid, ideal_radius, pinhole_cover
from texproj.render.shaders import BINDINGS, Program
from texproj.render.surface import Floats, Surface, hits_on_faces, images_of_hits
from texproj.render.target import Target, Tile, tiles

TILE_PX = 4096
"""Largest side of what is drawn at once: bounds the card's memory to about 0.5 GB."""

MAX_SAG_PX = 0.1
"""Largest distance of an edge's picture from where the lens bends it, at which the picture is drawn
with distorted vertices."""

STRIP_PX = 1 << 19
"""Pixels of a distorted photo that are computed at once."""


class GLRenderer:
    """An OpenGL context without a window."""

    def __init__(self, ctx: moderngl.Context, tile_px: int = TILE_PX) -> None:
        self.ctx = ctx
        limits = (ctx.info["GL_MAX_TEXTURE_SIZE"], *ctx.info["GL_MAX_VIEWPORT_DIMS"])
        self.limit = min(tile_px, *limits)
        version = f"{ctx.version_code // 100}.{ctx.version_code // 10 % 10}"
        self.name = f"OpenGL {version} ({ctx.info['GL_RENDERER']})"
        self.fallback_reason: str | None = None

    def __enter__(self) -> GLRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def load(self, mesh: Mesh, ambient_occlusion: Floats | None = None) -> GLScene:
        """The mesh on the card; close the scene (or use `with`) to release it."""
        return GLScene(self, Surface(mesh, ambient_occlusion))

    def close(self) -> None:
        """Release the context."""
        self.ctx.release()


class GLScene:
    """A mesh on the graphics card, with the programs that draw it."""

    def __init__(self, renderer: GLRenderer, surface: Surface) -> None:
        self.surface = surface
        self._ctx, self._limit = renderer.ctx, renderer.limit
        self._buffers: dict[str, Any] = {
            "faces": self._ctx.buffer(np.array(surface.mesh.faces)),
            "Camera": self._ctx.buffer(reserve=128),
            "Lens": self._ctx.buffer(reserve=128),
        }
        self._drawables: dict[tuple[tuple[str, ...], bool], tuple[Program, Any]] = {}
        self._target: Target | None = None

    def __enter__(self) -> GLScene:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release everything on the card."""
        if self._target is not None:
            self._target.release()
        for program, vao in self._drawables.values():
            vao.release()
            program.release()
        for buffer in self._buffers.values():
            buffer.release()
        self._target, self._drawables, self._buffers = None, {}, {}

    def gbuffer(
        self, camera: Camera, channels: Iterable[str] = ("depth", "normal", "face", "ao")
    ) -> GBuffer:
        """Images of the mesh at the photo's pixel centers, see `GBuffer`.

        With lens distortion the vertices go through the full model, which is exact where edges are
        short. Where an edge could stray by more than `MAX_SAG_PX`, faces are drawn by the covering
        pinhole camera instead, and each pixel's exact ray meets the face drawn nearest to it.
        """
        wanted = checked_channels(channels, self.surface.ao is not None)
        if camera.intrinsics.distorted and self._sag_px(camera) > MAX_SAG_PX:
            return GBuffer.from_channels(self._covered(camera, wanted))
        return GBuffer.from_channels(self._picture(camera, wanted))

    def _sag_px(self, camera: Camera) -> float:
        """How far edges could stray when only their ends are distorted; inf if it is not known."""
        k = camera.intrinsics
        radius = ideal_radius(k)
        if not np.isfinite(radius):
            return float("inf")
        stretch = 1 + radius**2  # of the pinhole picture per angle, at the corner
        span = self.surface.largest_span(camera) * stretch
        return bend(k) * span**2 / 8 * max(k.fx, k.fy)

    def _picture(self, camera: Camera, channels: tuple[str, ...]) -> dict[str, NDArray[Any]]:
        parts = tiles(camera.width, camera.height, self._limit)
        z = self.surface.depth_range(camera)
        if len(parts) == 1:
            return self._draw(camera, parts[0], z, channels)
        whole: dict[str, NDArray[Any]] = {}
        for tile in parts:
            for name, image in self._draw(camera, tile, z, channels).items():
                shape = (camera.height, camera.width, *image.shape[2:])
                whole.setdefault(name, np.empty(shape, image.dtype))[tile.slices] = image
        return whole

    def _covered(self, camera: Camera, channels: tuple[str, ...]) -> dict[str, NDArray[Any]]:
        cover = pinhole_cover(camera)
        faces = self._picture(cover, ("face",))["face"]
        grid = ideal_grid(camera.intrinsics)
        rows = max(1, STRIP_PX // camera.width)
        parts = []
        for y in range(0, camera.height, rows):
            strip = grid[y : y + rows]
            ideal = strip.reshape(-1, 2)
            hits = hits_on_faces(self.surface, camera, ideal, _nearest(faces, cover, ideal))
            images = images_of_hits(self.surface, camera, hits, channels)
            parts.append({k: v.reshape(*strip.shape[:2], *v.shape[1:]) for k, v in images.items()})
        return {name: np.concatenate([part[name] for part in parts]) for name in channels}

    def _draw(
        self, camera: Camera, tile: Tile, z: tuple[float, float], channels: tuple[str, ...]
    ) -> dict[str, NDArray[Any]]:
        k = camera.intrinsics
        drawable = self._drawable(channels, k.distorted)
        target = self._target_for((tile.width, tile.height), channels)
        target.clear()
        self._buffers["Camera"].write(camera_block(self.surface, camera, tile, z))
        if k.distorted:
            self._buffers["Lens"].write(lens_block(k))
        blocks = tuple((self._buffers[name], binding) for name, binding in BINDINGS.items())
        scope = self._ctx.scope(target.framebuffer, moderngl.DEPTH_TEST, uniform_buffers=blocks)
        with scope:
            self._ctx.front_face = "cw"
            self._ctx.depth_func = "<"
            drawable.render()
        return target.read()

    def _drawable(self, channels: tuple[str, ...], lens: bool) -> Any:
        if (channels, lens) not in self._drawables:
            defines = {f"{name.upper()}_AT": i for i, name in enumerate(channels)}
            defines |= {"LENS": 1} if lens else {}
            program = Program(self._ctx, "gbuffer.vert", "gbuffer.frag", defines)
            content = [(self._attribute("xyz_in_local"), "3f", "xyz_in_local")]
            if "normal" in channels:
                content.append((self._attribute("normals"), "3f", "normal_in_world"))
            if "ao" in channels:
                content.append((self._attribute("ao"), "1f", "occlusion"))
            vao = self._ctx.vertex_array(program.gl, content, self._buffers["faces"])
            self._drawables[channels, lens] = program, vao
        return self._drawables[channels, lens][1]

    def _attribute(self, name: str) -> Any:
        """The buffer of an array of the surface, filled when first used."""
        if name not in self._buffers:
            values = np.ascontiguousarray(getattr(self.surface, name), np.float32)
            self._buffers[name] = self._ctx.buffer(values)
        return self._buffers[name]

    def _target_for(self, size: tuple[int, int], channels: tuple[str, ...]) -> Target:
        """A target of this size; the last one is kept, since cameras repeat."""
        if self._target is None or self._target.key != (size, channels):
            if self._target is not None:
                self._target.release()
            self._target = Target(self._ctx, size, channels)
        return self._target


def _nearest(faces: NDArray[np.int32], cover: Camera, ideal: Floats) -> NDArray[np.int32]:
    """(n,) the face drawn at the cover's pixel nearest to each ray; -1 for rays without a value."""
    k = cover.intrinsics
    valid = np.isfinite(ideal[:, 0])
    ideal = np.where(valid[:, None], ideal, 0)
    x = np.floor(ideal[:, 0] * k.fx + k.cx).astype(np.int32).clip(0, k.width - 1)
    y = np.floor(ideal[:, 1] * k.fy + k.cy).astype(np.int32).clip(0, k.height - 1)
    return np.where(valid, faces[y, x], np.int32(-1))
