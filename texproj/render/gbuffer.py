"""What a camera sees of the mesh, pixel by pixel."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Bools, Doubles, Floats, Mask
from texproj.camera import Camera
from texproj.errors import nearest_name

CHANNELS = ("depth", "normal", "face", "ao", "front")


@dataclass(frozen=True, eq=False)
class GBuffer:
    """Images of the mesh at the pixel centers of a photo; a channel not asked for is None.

    Both sides of every face are drawn, so that whatever stands in the way hides what is behind.

    depth: (h, w) float32 along the optical axis in mesh units; inf = empty.
    normal_in_cam: (h, w, 3) float32 interpolated unit vertex normals, in camera axes, as the mesh
        gives them (a back side's normal points away from the camera); zero = empty.
    face: (h, w) int32 number of the face; -1 = empty.
    ao: (h, w) float32 ambient occlusion, 0 hidden .. 1 open; zero = empty.
    front: (h, w) bool, the face is seen from its outside (counter-clockwise); False = empty.
    """

    depth: NDArray[np.float32] | None = None
    normal_in_cam: NDArray[np.float32] | None = None
    face: NDArray[np.int32] | None = None
    ao: NDArray[np.float32] | None = None
    front: NDArray[np.bool_] | None = None

    @classmethod
    def from_channels(cls, images: dict[str, NDArray]) -> GBuffer:  # type: ignore[type-arg]
        """From images named as in `CHANNELS`."""
        return cls(**{"normal_in_cam" if k == "normal" else k: v for k, v in images.items()})

    @overload
    def require(self, channel: Literal["depth", "normal", "ao"]) -> Floats: ...

    @overload
    def require(self, channel: Literal["face"]) -> NDArray[np.int32]: ...

    @overload
    def require(self, channel: Literal["front"]) -> Bools: ...

    def require(self, channel: str) -> NDArray[Any]:
        """The image of a channel, named as in `CHANNELS`. Raises ValueError where the rendering
        was made without it, which is an error of the program.
        """
        there = self.channels()
        if channel not in there:
            raise ValueError(
                f"the rendering has no channel {channel!r}, only {', '.join(there) or 'none'}"
            )
        return there[channel]

    def outside(self) -> Mask:
        """(h, w) where the mesh's outside is seen; without the channel front, where any of the mesh
        is. Raises ValueError without the channel depth.
        """
        solid = np.isfinite(self.require("depth"))
        return solid if self.front is None else solid & self.front

    def points(self, camera: Camera, rows: NDArray[Any], columns: NDArray[Any]) -> Doubles:
        """(n, 3) float64 world points of the surface at the centers of pixels, rows (n,) and
        columns (n,) integers. camera: the one that it was rendered from, of the same size. NaN or
        inf where nothing is seen. Raises ValueError without the channel depth.
        """
        xy_px = np.stack([columns, rows], axis=1) + 0.5
        return camera.unproject(xy_px, self.require("depth")[rows, columns])

    def channels(self) -> dict[str, NDArray]:  # type: ignore[type-arg]
        """The images that exist, named as in `CHANNELS`."""
        found = {f.name: getattr(self, f.name) for f in fields(self)}
        return {k.removesuffix("_in_cam"): v for k, v in found.items() if v is not None}


def checked_channels(channels: Iterable[str], has_ao: bool) -> tuple[str, ...]:
    """`channels` without repetitions; ValueError for one that does not exist or has no source."""
    wanted = tuple(dict.fromkeys(channels))
    if not wanted:
        raise ValueError("no channel was asked for")
    for name in wanted:
        if name not in CHANNELS:
            raise ValueError(f"there is no channel {name!r}{nearest_name(name, CHANNELS)}")
    if "ao" in wanted and not has_ao:
        raise ValueError("the scene was loaded without ambient occlusion")
    return wanted
