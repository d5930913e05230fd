"""The mesh as a block is compared with it: samples of its surface, and rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.mesh import Mesh
from texproj.register.block.scan_samples import ScanSamples
from texproj.register.block.similarity import Similarity
from texproj.render.rays import RayCaster
from texproj.render.surface import Surface

SURFACE_STEP = 8
"""Every so many samples are enough to tell where in a photo the mesh is."""


@dataclass(frozen=True, eq=False)
class Scan:
    """samples: of the surface, in its unit frame; local_from_unit: to the ray caster's frame."""

    samples: ScanSamples
    caster: RayCaster
    local_from_unit: Similarity

    @classmethod
    def of(cls, mesh: Mesh, seed: int = 0) -> Scan:
        surface, samples = Surface(mesh), ScanSamples.of(mesh, seed)
        local_from_world = Similarity(1.0, np.eye(3), -surface.offset)
        return cls(
            samples,
            RayCaster(surface.xyz_in_local, mesh.faces),
            local_from_world @ samples.world_from_unit,
        )

    @property
    def surface(self) -> Doubles:
        """(n, 3) some points all over the mesh, world."""
        return self.samples.world_from_unit.apply(self.samples.xyz[::SURFACE_STEP])
