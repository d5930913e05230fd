"""The mesh as a block is compared with it: samples of its surface, and rays."""

from __future__ import annotations

from dataclasses import dataclass

from texproj.arrays import Doubles
from texproj.mesh import Mesh
from texproj.register.block.light_mesh import light_mesh
from texproj.register.block.scan_samples import ScanSamples
from texproj.render.rays import RayCaster

SURFACE_STEP = 8
"""Every so many samples are enough to tell where in a photo the mesh is."""


@dataclass(frozen=True, eq=False)
class Scan:
    """samples: of the surface; caster: of rays against a mesh of fewer faces where it has millions.
    Both in the frame in which the mesh has size 1.
    """

    samples: ScanSamples
    caster: RayCaster

    @classmethod
    def of(cls, mesh: Mesh, seed: int = 0) -> Scan:
        return cls._made(mesh, ScanSamples.of(mesh, seed))

    def relief(self, mesh: Mesh, seed: int = 0) -> Scan | None:
        """The mesh (the same) about what is neither floor nor wall, if that is another scale."""
        samples = ScanSamples.of_relief(mesh, self.samples, seed)
        return None if samples is None else self._made(mesh, samples)

    @classmethod
    def _made(cls, mesh: Mesh, samples: ScanSamples) -> Scan:
        unit_from_world, light = samples.world_from_unit.inverse, light_mesh(mesh)
        return cls(samples, RayCaster(unit_from_world.apply(light.vertices), light.faces))

    @property
    def surface(self) -> Doubles:
        """(n, 3) some points all over the mesh, world."""
        return self.samples.world_from_unit.apply(self.samples.xyz[::SURFACE_STEP])
