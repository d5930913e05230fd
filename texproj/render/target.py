"""Images that the graphics card draws into, and how they come back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

ATTACHMENTS = {
    "depth": (1, "f4"),
    "normal": (4, "f4"),
    "face": (4, "f1"),
    "ao": (1, "f4"),
    "front": (1, "f1"),
    "color": (4, "f1"),
}
"""Components and moderngl data type of each channel's image."""


@dataclass(frozen=True)
class Tile:
    """A rectangle of the picture, in pixels."""

    left: int
    top: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Its rows and columns in the whole picture."""
        rows = slice(self.top, self.top + self.height)
        return rows, slice(self.left, self.left + self.width)


def tiles(width: int, height: int, limit: int) -> list[Tile]:
    """Cover a picture with tiles of at most `limit` x `limit` pixels."""
    return [
        Tile(x, y, min(limit, width - x), min(limit, height - y))
        for y in range(0, height, limit)
        for x in range(0, width, limit)
    ]


@contextmanager
def drawing(
    ctx: moderngl.Context, target: Target, blocks: tuple[tuple[Any, int], ...]
) -> Iterator[None]:
    """The whole state of a pass that draws the mesh: nearest surface wins, both sides drawn, the
    outside counter-clockwise (clockwise where row 0 is the top). Left behind: moderngl's defaults.

    blocks: uniform buffers and their binding points.
    """
    target.framebuffer.use()
    ctx.enable_only(moderngl.DEPTH_TEST)
    ctx.front_face, ctx.depth_func = "cw", "<"
    for buffer, binding in blocks:
        buffer.bind_to_uniform_block(binding)
    try:
        yield
    finally:
        ctx.front_face, ctx.depth_func = "ccw", "<="
        ctx.enable_only(moderngl.NOTHING)
        ctx.detect_framebuffer(0).use()


class Target:
    """A framebuffer with one image per channel and a depth buffer."""

    def __init__(
        self, ctx: moderngl.Context, size: tuple[int, int], channels: tuple[str, ...]
    ) -> None:
        self.key = size, channels
        kinds = [ATTACHMENTS[name] for name in channels]
        images = [ctx.texture(size, n, dtype=kind) for n, kind in kinds]
        depth = ctx.depth_renderbuffer(size)
        self.framebuffer: Any = ctx.framebuffer(images, depth)
        self._parts: tuple[Any, ...] = (self.framebuffer, depth, *images)

    def clear(self) -> None:
        """Everything to zero, depth to infinity."""
        channels = self.key[1]
        alone = channels == ("depth",)
        self.framebuffer.clear(*(np.inf if alone else 0.0,) * 4)
        if "depth" in channels and not alone:
            self.framebuffer.color_mask = tuple((name == "depth",) * 4 for name in channels)
            self.framebuffer.clear(*(np.inf,) * 4)
            self.framebuffer.color_mask = ((True,) * 4,) * len(channels)

    def read(self) -> dict[str, NDArray[Any]]:
        """The images by name; row 0 is the top row of the picture."""
        return {name: self._read(i, name) for i, name in enumerate(self.key[1])}

    def _read(self, attachment: int, name: str) -> NDArray[Any]:
        components, kind = ATTACHMENTS[name]
        (width, height), dtype = self.key[0], np.float32 if kind == "f4" else np.uint8
        image = np.empty((height, width, components), dtype)
        self.framebuffer.read_into(
            image, components=components, attachment=attachment, alignment=1, dtype=kind
        )
        if name == "face":
            number: NDArray[np.int32] = image.view("<i4")[..., 0] - np.int32(1)
            return number
        if name == "front":
            return image[..., 0] > 0
        return image if name == "color" else image[..., :3] if name == "normal" else image[..., 0]

    def release(self) -> None:
        """Give the card's memory back."""
        for part in self._parts:
            part.release()
