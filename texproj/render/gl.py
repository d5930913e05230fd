"""The OpenGL renderer: a context without a window, and a mesh that lives on it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.errors import RenderError
from texproj.mesh import Mesh
from texproj.render.blocks import camera_block, lens_block
from texproj.render.gbuffer import GBuffer, checked_channels
from texproj.render.geometry import Geometry
from texproj.render.lens import fills_photo, ideal_grid
from texproj.render.shaders import BINDINGS, Program
from texproj.render.surface import Surface
from texproj.render.target import Target, Tile, drawing, tiles

TILE_PX = 4096
"""Largest side of what is drawn at once: bounds the card's memory to about 0.5 GB."""

EMPTY = {"depth": np.inf, "face": -1}
"""Values of pixels that see nothing, where not zero."""


class GLRenderer:
    """An OpenGL context without a window."""

    def __init__(
        self,
        ctx: moderngl.Context,
        tile_px: int = TILE_PX,
        remake: Callable[[], moderngl.Context] | None = None,
    ) -> None:
        """`remake`: another context of the same kind; without it the renderer does not rest."""
        self.ctx, self._remake = ctx, remake
        self.scenes = 0
        limits = (ctx.info["GL_MAX_TEXTURE_SIZE"], *ctx.info["GL_MAX_VIEWPORT_DIMS"])
        self.limit = min(tile_px, *limits)
        version = f"{ctx.version_code // 100}.{ctx.version_code // 10 % 10}"
        self.name = f"OpenGL {version} ({ctx.info['GL_RENDERER']})"
        self.fallback_reason: str | None = None
        self.closed = False
        self._lock, self._inside, self._resting = threading.RLock(), False, False
        with ctx:  # and then current in no thread
            pass

    @contextmanager
    def current(self) -> Iterator[None]:
        """Makes this the context that OpenGL calls go to; whatever touches `ctx` belongs inside.

        May be nested, and used from any thread, one at a time. Raises RenderError for what OpenGL
        reports meanwhile, such as no memory left.
        """
        if self.closed:
            raise RenderError("The renderer is closed already.")
        with self._lock:
            if self._inside:
                yield
                return
            self._inside = True
            try:
                with self.ctx:
                    yield
                    error = self.ctx.error
            except moderngl.Error as failure:
                raise RenderError(f"OpenGL failed: {failure}; try the renderer cpu.") from failure
            finally:
                self._inside = False
            if error != "GL_NO_ERROR":
                raise RenderError(f"OpenGL failed: {error}; try the renderer cpu.")

    def __enter__(self) -> GLRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def load(self, mesh: Mesh, ambient_occlusion: Floats | None = None) -> GLScene:
        """The mesh on the card; close the scene (or use `with`) to release it."""
        with self._lock:
            if self._resting and self._remake is not None:
                self.ctx, self._resting = self._remake(), False
                with self.ctx:
                    pass
            with self.current():
                scene = GLScene(self, Surface(mesh, ambient_occlusion))
            self.scenes += 1
        return scene

    def rest(self) -> None:
        """Release the context, unless a scene is open; the next one gets a new one."""
        with self._lock:
            if self._remake is not None and not (self.scenes or self.closed or self._resting):
                self._resting = True
                self.ctx.release()

    def close(self) -> None:
        """Release the context, and with it every scene."""
        if not self.closed:
            self.closed = True
            if not self._resting:
                self.ctx.release()


class GLScene:
    """A mesh on the graphics card, with the programs that draw it."""

    def __init__(self, renderer: GLRenderer, surface: Surface) -> None:
        self.surface = surface
        self._renderer, self._ctx = renderer, renderer.ctx
        self._geometry = Geometry(self._ctx, surface)
        self._blocks = {name: self._ctx.buffer(reserve=128) for name in BINDINGS}
        self._programs: dict[tuple[tuple[str, ...], bool], Program] = {}
        self._target: Target | None = None

    def __enter__(self) -> GLScene:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release everything on the card."""
        if self._renderer.closed or not self._blocks:
            return
        with self._renderer.current():
            self._geometry.release()
            if self._target is not None:
                self._target.release()
            for program in self._programs.values():
                program.release()
            for block in self._blocks.values():
                block.release()
        self._target, self._programs, self._blocks = None, {}, {}
        self._renderer.scenes -= 1

    def gbuffer(
        self, camera: Camera, channels: Iterable[str] = ("depth", "normal", "face", "ao")
    ) -> GBuffer:
        """Images of the mesh at the photo's pixel centers, see `GBuffer`.

        Vertices go through the full lens model; edges that it bends visibly are split first.
        """
        wanted = checked_channels(channels, self.surface.occlusion is not None)
        if not self._blocks:
            raise RenderError("The scene is closed already.")
        with self._renderer.current():
            if camera.intrinsics.distorted:
                self._geometry.straighten(camera)
            images = self._picture(camera, wanted)
        if "face" in images:
            images["face"] = self._geometry.faces_of_mesh(images["face"])
        if not fills_photo(camera.intrinsics):
            outside = np.isnan(ideal_grid(camera.intrinsics)[..., 0])
            for name, image in images.items():
                image[outside] = EMPTY.get(name, 0)
        return GBuffer.from_channels(images)

    def _picture(self, camera: Camera, channels: tuple[str, ...]) -> dict[str, NDArray[Any]]:
        parts = tiles(camera.width, camera.height, self._renderer.limit)
        z = self.surface.depth_range(camera)
        if len(parts) == 1:
            return self._draw(camera, parts[0], z, channels)
        whole: dict[str, NDArray[Any]] = {}
        for tile in parts:
            for name, image in self._draw(camera, tile, z, channels).items():
                shape = (camera.height, camera.width, *image.shape[2:])
                whole.setdefault(name, np.empty(shape, image.dtype))[tile.slices] = image
        return whole

    def _draw(
        self, camera: Camera, tile: Tile, z: tuple[float, float], channels: tuple[str, ...]
    ) -> dict[str, NDArray[Any]]:
        k = camera.intrinsics
        program = self._program(channels, k.distorted)
        vertices = self._geometry.vertex_array(program)
        target = self._target_for((tile.width, tile.height), channels)
        target.clear()
        self._blocks["Camera"].write(camera_block(self.surface, camera, tile, z))
        if k.distorted:
            self._blocks["Lens"].write(lens_block(k))
        blocks = tuple((self._blocks[name], binding) for name, binding in BINDINGS.items())
        with drawing(self._ctx, target, blocks):
            vertices.render()
        return target.read()

    def _program(self, channels: tuple[str, ...], lens: bool) -> Program:
        if (channels, lens) not in self._programs:
            defines = {f"{name.upper()}_AT": i for i, name in enumerate(channels)}
            defines |= {"LENS": 1} if lens else {}
            program = Program(self._ctx, "gbuffer.vert", "gbuffer.frag", defines)
            self._programs[channels, lens] = program
        return self._programs[channels, lens]

    def _target_for(self, size: tuple[int, int], channels: tuple[str, ...]) -> Target:
        """A target of this size; the last one is kept, since cameras repeat."""
        if self._target is None or self._target.key != (size, channels):
            if self._target is not None:
                self._target.release()
            self._target = Target(self._ctx, size, channels)
        return self._target
