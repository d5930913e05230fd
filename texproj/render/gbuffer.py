"""What a camera sees of the mesh, pixel by pixel."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

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
