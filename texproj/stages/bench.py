"""The workbench: what several stages need of the mesh, made once and only when asked for."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from texproj.camera import Camera
from texproj.mesh import Mesh, MeshSource
from texproj.photo import Correspondences
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.resources.workers import Workers
from texproj.stages.entries import camera_hash

if TYPE_CHECKING:
    from texproj.register.features import Known
    from texproj.render import GBuffer, Renderer, Scene
    from texproj.solve.features import Features

K = TypeVar("K")
V = TypeVar("V")

SURFACE_SAMPLES = 2000
FEATURES_LONGEST = 1280
"""Longer side, pixels, to which photos are reduced to find features."""
REGISTRATION_CHANNELS = ("depth", "normal", "ao")


class Recent(Generic[K, V]):
    """The values of the latest keys, so that memory does not grow with the photos."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._values: dict[K, V] = {}

    def of(self, key: K, make: Callable[[], V]) -> V:
        """The value of `key`, made where it is not kept."""
        value = self._values.pop(key) if key in self._values else make()
        self._values[key] = value
        while len(self._values) > self._most:
            self._values.pop(next(iter(self._values)))
        return value


class Crew(Workers, Protocol):
    """Workers that know a project: a task of theirs gets its workbench there before all else."""

    def bring(self, *places: Path) -> None:
        """Have files and folders of the project that were made since where workers see them."""


class Workbench:
    """Mesh, renderer and scene of a project; a context manager that releases them.

    crew: the workers of a cluster that know the project, if one was asked for.
    """

    def __init__(self, project: Project, crew: Crew | None = None) -> None:
        self.project, self.crew = project, crew
        self._open = ExitStack()
        self._features: Recent[str, Features] = Recent(128)
        self._known: Recent[tuple[str, str], Known] = Recent(16)
        self._pairs: Recent[tuple[str, str, str], Correspondences] = Recent(10_000)

    def __enter__(self) -> Workbench:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._open.close()

    @cached_property
    def source(self) -> MeshSource:
        """The repaired mesh and how it maps to the file."""
        return self.project.load_mesh()

    @property
    def mesh(self) -> Mesh:
        return self.source.mesh

    @cached_property
    def surface_sample(self) -> NDArray[np.float64]:
        """(n, 3) vertices spread over the mesh: where an expected error is averaged."""
        step = max(1, len(self.mesh.vertices) // SURFACE_SAMPLES)
        return self.mesh.vertices[::step]

    @cached_property
    def renderer(self) -> Renderer:
        """OpenGL or the ray caster, as the settings say."""
        from texproj.render import open_renderer  # noqa: PLC0415 - slow to load

        options = self.project.settings.render
        return self._open.enter_context(open_renderer(options))

    @cached_property
    def occlusion(self) -> NDArray[np.float32]:
        """(V,) ambient occlusion of the mesh, kept in work/ between runs."""
        from texproj.render import ambient_occlusion  # noqa: PLC0415 - slow to load

        known = self.kept_occlusion
        if known is not None:
            return known
        values = ambient_occlusion(self.mesh)
        self.keep_occlusion(values)
        return values

    def keep_occlusion(self, values: NDArray[np.float32]) -> None:
        """Have ambient occlusion in work/, where other processes find it."""
        self.project.save_array(self._occlusion_key, values)

    @property
    def occlusion_path(self) -> Path:
        """Where it is kept."""
        return self.project.array_path(self._occlusion_key)

    @property
    def kept_occlusion(self) -> NDArray[np.float32] | None:
        """(V,) ambient occlusion of an earlier run, None if there is none."""
        known = self.project.load_array(self._occlusion_key)
        return known if known is not None and known.shape == (len(self.mesh.vertices),) else None

    @property
    def _occlusion_key(self) -> str:
        return f"occlusion-{self.project.hash_of(self.project.mesh_path)}"

    @cached_property
    def scene(self) -> Scene:
        """The mesh with its ambient occlusion, ready to be rendered."""
        return self._open.enter_context(self.renderer.load(self.mesh, self.occlusion))

    @property
    def plain_scene(self) -> Scene:
        """The mesh as it is needed where ambient occlusion is not."""
        if "scene" in vars(self):
            return self.scene
        return self._bare_scene

    @cached_property
    def light_scene(self) -> Scene:
        """The mesh with its ambient occlusion for comparing it with reduced photos: one of fewer
        faces where it has millions.
        """
        from texproj.register.block.light_mesh import light_mesh  # noqa: PLC0415 - slow to load
        from texproj.render import ambient_occlusion  # noqa: PLC0415

        light = light_mesh(self.mesh)
        if light is self.mesh:
            return self.scene
        return self._open.enter_context(self.renderer.load(light, ambient_occlusion(light)))

    @cached_property
    def _bare_scene(self) -> Scene:
        return self._open.enter_context(self.renderer.load(self.mesh))

    def features(self, name: str) -> Features:
        """The features of a photo, found at a reduced size, in full-size pixels."""
        return self._features.of(name, lambda: self._found_features(name))

    def _found_features(self, name: str) -> Features:
        from texproj.solve.features import find_features  # noqa: PLC0415 - slow to load

        photo = self.project.load_photo(name, FEATURES_LONGEST)
        valid = None if photo.mask is None else photo.mask > 0
        found = find_features(photo.gray(), valid)
        to_full = photo.info.width / photo.width
        return replace(found, xy_px=found.xy_px * to_full)

    def pairs(self, name: str, other: CameraRecord) -> Correspondences:
        """Pixels of photo `name` with the points of the mesh that a registered one shows there."""
        from texproj.register.features import pairs_with  # noqa: PLC0415 - slow to load

        known = (other.file, camera_hash(other))
        return self._pairs.of(
            (name, *known),
            lambda: pairs_with(
                self.features(name), self._known.of(known, lambda: self._seen(other))
            ),
        )

    def _seen(self, record: CameraRecord) -> Known:
        """A registered photo as others are compared with it."""
        from texproj.register.features import Known  # noqa: PLC0415 - slow to load

        camera = record.registered_camera
        assert camera is not None
        small = camera.reduced(FEATURES_LONGEST)
        depth = self.plain_scene.gbuffer(small, ("depth",)).require("depth")
        error = float(record.quality.get("expected_error_px") or 0)
        return Known(camera, self.features(record.file), depth, error)

    def render(self, camera: Camera) -> GBuffer:
        """Depth, normals and ambient occlusion from `camera`."""
        return self.scene.gbuffer(camera, REGISTRATION_CHANNELS)
