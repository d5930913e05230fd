"""What every renderer offers; OpenGL and the ray caster are two of the same kind."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.mesh import Mesh
from texproj.render.gbuffer import GBuffer
from texproj.render.surface import Surface

Render = Callable[[Camera], GBuffer]
"""Images of one mesh, with the channels that the caller needs, from any camera."""


class Scene(Protocol):
    """A mesh that can be looked at from any camera; a context manager."""

    @property
    def surface(self) -> Surface:
        """The mesh in scene coordinates."""

    def gbuffer(self, camera: Camera, channels: Iterable[str] = ...) -> GBuffer:
        """Images of the mesh at the photo's pixel centers, see `GBuffer`.

        channels: any of depth, normal, face, ao, front; only these are computed.
        """

    def close(self) -> None:
        """Release what the scene holds."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None, /,
    ) -> None: ...  # fmt: skip


class Renderer(Protocol):
    """A way to make images of meshes; a context manager.

    name: what it is, for reports; fallback_reason: why it was taken instead of OpenGL, or None.
    """

    name: str
    fallback_reason: str | None

    def load(self, mesh: Mesh, ambient_occlusion: NDArray[np.float32] | None = None) -> Scene:
        """The mesh (world, any coordinates) with, if given, (V,) ambient occlusion."""

    def rest(self) -> None:
        """Give memory back until the next mesh is loaded, unless a scene is open."""

    def close(self) -> None:
        """Release what the renderer holds."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None, /,
    ) -> None: ...  # fmt: skip
