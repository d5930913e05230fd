"""The project's mesh as the page needs it: loaded once, packed, simplified, and hit by rays."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.mesh import Mesh, MeshSource, face_normals, vertex_normals
from texproj.preview.door import leaves
from texproj.preview.geometry import LightMesh, is_large, pack_mesh, simplified
from texproj.project import Project
from texproj.render import ambient_occlusion
from texproj.render.rays import RayCaster


@dataclass(frozen=True, eq=False)
class Hit:
    """A point of the surface. xyz: (3,) float64 world; normal: (3,) unit; face: its number; back:
    whether it is seen from behind.
    """

    xyz: NDArray[np.float64]
    normal: NDArray[np.float64]
    face: int
    back: bool = False

    def as_dict(self) -> dict[str, Any]:
        return {"xyz": self.xyz.tolist(), "normal": self.normal.tolist(), "back": self.back}


class Surface:
    """The mesh of a project. Safe to use from several threads."""

    def __init__(self, project: Project, light_faces: int) -> None:
        self.project = project
        self.light_faces = light_faces
        self.key = project.hash_of(project.mesh_path) or "none"
        self._lock = threading.RLock()
        self._light_lock = threading.Lock()  # simplifying takes long; rays need not wait for it

    @cached_property
    def source(self) -> MeshSource:
        """The repaired mesh and how it maps to the file. Raises InputError."""
        with self._lock:
            try:
                return self.project.load_mesh()
            except InputError:
                path = self.project.mesh_path
                if leaves(path, self.project.root):  # the reason may quote what stands in it
                    raise InputError(f"{path.name} cannot be read as a mesh") from None
                raise

    @property
    def mesh(self) -> Mesh:
        with self._lock:
            return self.source.mesh

    @cached_property
    def full_pack(self) -> bytes:
        """The full mesh for the page."""
        with self._lock:
            return pack_mesh(self.mesh, self.mesh.center, len(self.mesh.faces))

    @property
    def first_pack(self) -> bytes:
        """What the page shows at first: the full mesh, or the light one of a large mesh."""
        if is_large(self.mesh) and (light := self.light_pack) is not None:
            return light
        return self.full_pack

    @cached_property
    def light(self) -> LightMesh | None:
        """The simplified mesh; None for a mesh small enough."""
        with self._light_lock:
            return simplified(self.mesh, self.light_faces)

    @cached_property
    def light_pack(self) -> bytes | None:
        """The simplified mesh for the page, with `vertex_of_light`."""
        if self.light is None:
            return None
        nearest = self.light.vertex_of_light.astype(np.uint32)
        whole = self.mesh
        return pack_mesh(self.light.mesh, whole.center, len(whole.faces), vertex_of_light=nearest)

    def first_hits(
        self, origins: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.int32]:
        """(n,) number of the face that each ray (world, unit directions) meets first, or -1."""
        center = self.mesh.center
        with self._lock:
            return self._rays.first(origins - center, directions).face

    def points_on(
        self,
        faces: NDArray[np.int32],
        origins: NDArray[np.float64],
        directions: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """(n, 3) float64 crossings of rays with the planes of their faces; the ray caster itself
        counts in float32."""
        corner = self.mesh.vertices[self.mesh.faces[faces, 0]]
        normal = self._normals[faces]
        along = np.einsum("ij,ij->i", directions, normal)
        along = np.where(along == 0, np.nan, along)
        return (
            origins
            + (np.einsum("ij,ij->i", corner - origins, normal) / along)[:, None] * directions
        )

    def hit(self, origin: NDArray[np.float64], direction: NDArray[np.float64]) -> Hit | None:
        """Where a ray (world) first meets the surface."""
        direction = direction / np.linalg.norm(direction)
        face = self.first_hits(origin[None], direction[None])
        if face[0] < 0:
            return None
        xyz = self.points_on(face, origin[None], direction[None])[0]
        if not np.isfinite(xyz).all():
            return None
        normal = self._normals[face[0]]
        return Hit(xyz, normal, int(face[0]), bool(direction @ normal > 0))

    def normals_of(self, faces: NDArray[np.int32]) -> NDArray[np.float64]:
        """(n, 3) unit normals of faces."""
        return self._normals[faces]

    def nearest_normals(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) unit normals of the faces around the vertices nearest to (n, 3) points."""
        if not len(xyz):
            return np.empty((0, 3))
        vertex = self._tree.query(xyz)[1]
        return self._vertex_normals[vertex]

    @cached_property
    def occlusion(self) -> NDArray[np.float32]:
        """(V,) ambient occlusion, for layers that are only looked at."""
        return ambient_occlusion(self.mesh)

    @cached_property
    def _normals(self) -> NDArray[np.float64]:
        return face_normals(self.mesh)

    @cached_property
    def _vertex_normals(self) -> NDArray[np.float64]:
        return vertex_normals(self.mesh)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree  # noqa: PLC0415 - slow to import, rarely needed

        return cKDTree(self.mesh.vertices)

    @cached_property
    def _rays(self) -> RayCaster:
        return RayCaster(self.mesh.vertices - self.mesh.center, self.mesh.faces)
