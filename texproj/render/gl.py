"""The OpenGL renderer: a context without a window, and a mesh that lives on it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.mesh import Mesh, vertex_normals
from texproj.render.gbuffer import GBuffer, checked_channels
from texproj.render.shaders import Program

ATTACHMENTS = {
    "depth": (1, "f4"),
    "normal": (4, "f4"),
    "face": (4, "f1"),
    "ao": (1, "f4"),
    "front": (1, "f1"),
}
"""Components and moderngl data type of each channel's image."""

NEAR_OF_FAR = 1e-3
"""Nearest depth that is drawn, as a part of the farthest, where the mesh reaches behind the camera.
Otherwise the nearest vertex is the near plane, and a 24-bit depth buffer is precise."""


@dataclass(frozen=True)
class Tile:
    """A rectangle of the picture, in pixels."""

    left: int
    top: int
    width: int
    height: int


def tiles(width: int, height: int, limit: int) -> list[Tile]:
    """Cover a picture with tiles of at most `limit` x `limit` pixels."""
    return [
        Tile(x, y, min(limit, width - x), min(limit, height - y))
        for y in range(0, height, limit)
        for x in range(0, width, limit)
    ]


def camera_block(
    camera: Camera, offset: NDArray[np.float64], tile: Tile, z: tuple[float, float]
) -> bytes:
    """The bytes of the shaders' Camera block for one tile of a pinhole camera.

    offset: (3,) world position of the scene's origin; z: near and far depth.
    """
    cam_from_local = np.eye(4)
    cam_from_local[:3, :3] = camera.pose.R
    cam_from_local[:3, 3] = camera.pose.apply(offset[None])[0]
    columns = [cam_from_local.T, clip_from_cam(camera, tile, *z).T]
    return np.stack(columns).astype(np.float32).tobytes()


def clip_from_cam(camera: Camera, tile: Tile, near: float, far: float) -> NDArray[np.float64]:
    """(4, 4) projection of the camera's pinhole part onto a tile; clip w is the depth."""
    k = camera.intrinsics
    w, h = tile.width, tile.height
    return np.array(
        [
            [2 * k.fx / w, 0, 2 * (k.cx - tile.left) / w - 1, 0],
            [0, 2 * k.fy / h, 2 * (k.cy - tile.top) / h - 1, 0],
            [0, 0, (far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, 1, 0],
        ]
    )


class GLScene:
    """A mesh on the graphics card, with the programs that draw it."""

    def __init__(
        self, ctx: moderngl.Context, mesh: Mesh, ao: NDArray[np.float32] | None, limit: int
    ) -> None:
        self.ctx, self.mesh, self.limit = ctx, mesh, limit
        self.offset = mesh.center
        self.xyz_in_local = np.ascontiguousarray(mesh.vertices - self.offset, np.float32)
        self._buffers: dict[str, Any] = {
            "xyz_in_local": ctx.buffer(self.xyz_in_local),
            "faces": ctx.buffer(np.ascontiguousarray(mesh.faces)),
            "camera": ctx.buffer(reserve=128),
        }
        if ao is not None:
            self._buffers["occlusion"] = ctx.buffer(np.ascontiguousarray(ao, np.float32))
        self._drawables: dict[tuple[str, ...], tuple[Program, Any]] = {}
        self._target: tuple[Any, Any] | None = None

    def __enter__(self) -> GLScene:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release everything on the card."""
        self._release_target()
        for program, vao in self._drawables.values():
            vao.release()
            program.gl.release()
        for buffer in self._buffers.values():
            buffer.release()
        self._drawables, self._buffers = {}, {}

    def gbuffer(
        self, camera: Camera, channels: Iterable[str] = ("depth", "normal", "face", "ao")
    ) -> GBuffer:
        """Images of the mesh at the photo's pixel centers."""
        wanted = checked_channels(channels)
        if "ao" in wanted and "occlusion" not in self._buffers:
            raise ValueError("the scene was loaded without ambient occlusion")
        return GBuffer.from_channels(self._pinhole_images(camera, wanted))

    def _pinhole_images(self, camera: Camera, channels: tuple[str, ...]) -> dict[str, NDArray[Any]]:
        parts = tiles(camera.width, camera.height, self.limit)
        z = self._depth_range(camera)
        if len(parts) == 1:
            return self._draw(camera, parts[0], z, channels)
        whole: dict[str, NDArray[Any]] = {}
        for tile in parts:
            for name, image in self._draw(camera, tile, z, channels).items():
                shape = (camera.height, camera.width, *image.shape[2:])
                out = whole.setdefault(name, np.empty(shape, image.dtype))
                out[tile.top : tile.top + tile.height, tile.left : tile.left + tile.width] = image
        return whole

    def _depth_range(self, camera: Camera) -> tuple[float, float]:
        """Near and far depth that hold the mesh as seen from `camera`."""
        axis = camera.pose.R[2]
        depth = self.xyz_in_local @ axis.astype(np.float32)
        depth = depth + np.float32(camera.pose.apply(self.offset[None])[0, 2])
        far = max(float(depth.max()) * 1.001, 1e-30)
        near = float(depth.min()) * 0.999
        return max(near, far * NEAR_OF_FAR), far

    def _draw(
        self, camera: Camera, tile: Tile, z: tuple[float, float], channels: tuple[str, ...]
    ) -> dict[str, NDArray[Any]]:
        ctx = self.ctx
        program, vao = self._drawable(channels)
        target = self._framebuffer(tile.width, tile.height, channels)
        self._buffers["camera"].write(camera_block(camera, self.offset, tile, z))
        self._buffers["camera"].bind_to_uniform_block(0)
        with ctx.scope(target, enable_only=moderngl.DEPTH_TEST):
            ctx.front_face = "cw"
            ctx.depth_func = "<"
            vao.render()
        return {name: _read(target, i, name, tile) for i, name in enumerate(channels)}

    def _drawable(self, channels: tuple[str, ...]) -> tuple[Program, Any]:
        if channels not in self._drawables:
            defines = {f"{name.upper()}_AT": i for i, name in enumerate(channels)}
            program = Program(self.ctx, "gbuffer.vert", "gbuffer.frag", defines)
            content = [(self._buffers["xyz_in_local"], "3f", "xyz_in_local")]
            if "normal" in channels:
                content.append((self._normals(), "3f", "normal_in_local"))
            if "ao" in channels:
                content.append((self._buffers["occlusion"], "1f", "occlusion"))
            vao = self.ctx.vertex_array(program.gl, content, self._buffers["faces"])
            self._drawables[channels] = program, vao
        return self._drawables[channels]

    def _normals(self) -> Any:
        if "normal_in_local" not in self._buffers:
            normals = vertex_normals(self.mesh).astype(np.float32)
            self._buffers["normal_in_local"] = self.ctx.buffer(normals)
        return self._buffers["normal_in_local"]

    def _framebuffer(self, width: int, height: int, channels: tuple[str, ...]) -> Any:
        """A cleared target of this size; the last one is kept, since cameras repeat."""
        key = (width, height, channels)
        if self._target is None or self._target[0] != key:
            self._release_target()
            kinds = [ATTACHMENTS[name] for name in channels]
            images = [self.ctx.texture((width, height), n, dtype=kind) for n, kind in kinds]
            depth = self.ctx.depth_renderbuffer((width, height))
            self._target = key, self.ctx.framebuffer(images, depth)
        _clear(self._target[1], channels)
        return self._target[1]

    def _release_target(self) -> None:
        if self._target is not None:
            framebuffer = self._target[1]
            for part in (*framebuffer.color_attachments, framebuffer.depth_attachment, framebuffer):
                part.release()
        self._target = None


def _clear(framebuffer: Any, channels: tuple[str, ...]) -> None:
    """Everything to zero, depth to infinity."""
    framebuffer.clear(*(0.0,) * 4)
    if channels == ("depth",):
        framebuffer.clear(*(np.inf,) * 4)
    elif "depth" in channels:
        framebuffer.color_mask = tuple((name == "depth",) * 4 for name in channels)
        framebuffer.clear(*(np.inf,) * 4)
        framebuffer.color_mask = ((True,) * 4,) * len(channels)


def _read(framebuffer: Any, attachment: int, name: str, tile: Tile) -> NDArray[Any]:
    components, kind = ATTACHMENTS[name]
    dtype = np.float32 if kind == "f4" else np.uint8
    image = np.empty((tile.height, tile.width, components), dtype)
    framebuffer.read_into(
        image, components=components, attachment=attachment, dtype=kind, alignment=1
    )
    if name == "face":
        return image.view("<i4")[..., 0] - np.int32(1)
    if name == "front":
        return image[..., 0] > 0
    return image[..., :3] if name == "normal" else image[..., 0]


class GLRenderer:
    """An OpenGL context without a window."""

    def __init__(self, ctx: moderngl.Context, max_tile_px: int | None = None) -> None:
        self.ctx = ctx
        limits = (ctx.info["GL_MAX_TEXTURE_SIZE"], *ctx.info["GL_MAX_VIEWPORT_DIMS"])
        self.limit = min(4096, *limits, max_tile_px or limits[0])
        version = f"{ctx.version_code // 100}.{ctx.version_code // 10 % 10}"
        self.name = f"OpenGL {version} ({ctx.info['GL_RENDERER']})"
        self.fallback_reason: str | None = None

    def __enter__(self) -> GLRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def load(self, mesh: Mesh, ambient_occlusion: NDArray[np.float32] | None = None) -> GLScene:
        """The mesh on the card; close the scene (or use `with`) to release it."""
        return GLScene(self.ctx, mesh, ambient_occlusion, self.limit)

    def close(self) -> None:
        """Release the context."""
        self.ctx.release()
