"""The CPU twin: exact rays through the full lens model, cast by Embree (Wald et al. 2014)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.mesh import Mesh
from texproj.render.gbuffer import GBuffer, checked_channels
from texproj.render.lens import ideal_grid
from texproj.render.surface import Hits, Surface, images_of_hits

CHUNK = 1 << 19
"""Rays cast at a time; bounds memory to about 100 MB."""

Reals = NDArray[np.floating[Any]]


class RayCaster:
    """Embree's tree over triangles. All coordinates are float32, so that the origin must be near.

    Embree runs in its robust mode, so that no ray slips through between two faces.
    """

    def __init__(self, xyz: NDArray[Any], faces: NDArray[Any]) -> None:
        """Build the tree. xyz: (V, 3) vertices; faces: (F, 3) their rows."""
        self._scene = EmbreeScene(robust=True)
        self._faces = TriangleMesh(self._scene, _float32(xyz), np.array(faces, np.int32))

    def first(self, origins: Reals, directions: Reals) -> Hits:
        """The first faces met by rays (n, 3), (n, 3): hits whose depth counts lengths of
        `directions`, inf where nothing is met.
        """
        out = self._scene.run(_float32(origins), _float32(directions), output=True)
        missed = out["primID"] < 0
        depth = np.where(missed, np.float32(np.inf), out["tfar"])
        return Hits(out["primID"], depth, out["u"], out["v"])

    def blocked(
        self, origins: Reals, directions: Reals, reach: Reals | None = None
    ) -> NDArray[np.bool_]:
        """(n,) whether anything is met within `reach` (n,) lengths of `directions`."""
        limit = None if reach is None else _float32(reach)
        out = self._scene.run(_float32(origins), _float32(directions), limit, query="OCCLUDED")
        return out >= 0


class CPUScene:
    """A mesh in the ray caster."""

    def __init__(self, surface: Surface) -> None:
        self.surface = surface
        self.caster = RayCaster(surface.xyz_in_local, surface.mesh.faces)

    def __enter__(self) -> CPUScene:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Nothing to release: memory is the interpreter's."""

    def gbuffer(
        self, camera: Camera, channels: Iterable[str] = ("depth", "normal", "face", "ao")
    ) -> GBuffer:
        """Images of the mesh at the photo's pixel centers, see `GBuffer`."""
        wanted = checked_channels(channels, self.surface.occlusion is not None)
        rows = max(1, CHUNK // camera.width)
        grid = ideal_grid(camera.intrinsics)
        parts = [self._strip(camera, grid[y : y + rows], wanted) for y in range(0, len(grid), rows)]
        return GBuffer.from_channels({k: np.concatenate([p[k] for p in parts]) for k in wanted})

    def _strip(
        self, camera: Camera, ideal: Floats, channels: tuple[str, ...]
    ) -> dict[str, NDArray[Any]]:
        hits = self._cast(camera, ideal.reshape(-1, 2))
        images = images_of_hits(self.surface, camera, hits, channels)
        return {k: v.reshape(*ideal.shape[:2], *v.shape[1:]) for k, v in images.items()}

    def _cast(self, camera: Camera, ideal: Floats) -> Hits:
        """Rays start at the near plane, where the OpenGL renderer's pictures start too."""
        near, _ = self.surface.depth_range(camera)
        valid = np.isfinite(ideal[:, 0])
        rays = np.concatenate(
            [np.where(valid[:, None], ideal, 0), np.ones((len(ideal), 1))], axis=1
        )
        directions = rays @ camera.pose.R
        center = camera.center - self.surface.offset
        hits = self.caster.first(center + near * directions, directions)
        face = np.where(valid, hits.face, np.int32(-1))
        return Hits(face, hits.depth + np.float32(near), hits.u, hits.v)


class CPURenderer:
    """The renderer that needs nothing but the processor."""

    name = "CPU ray caster (Embree)"

    def __init__(self, fallback_reason: str | None = None) -> None:
        self.fallback_reason = fallback_reason

    def __enter__(self) -> CPURenderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def load(self, mesh: Mesh, ambient_occlusion: Floats | None = None) -> CPUScene:
        """The mesh in the ray caster."""
        return CPUScene(Surface(mesh, ambient_occlusion))

    def rest(self) -> None:
        """Nothing to give back."""

    def close(self) -> None:
        """Nothing to release."""


def _float32(values: NDArray[Any]) -> Floats:
    return np.ascontiguousarray(values, np.float32)
