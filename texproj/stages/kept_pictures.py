"""The report's pictures, kept in work/pictures/ from report to report: drawing them takes most of a
report's time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from texproj.camera import Camera
from texproj.files import json_hash
from texproj.formats.cameras import camera_part
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.coloring import STAGE as COLOR
from texproj.stages.freshness import Inputs, file_inputs, options_inputs
from texproj.version import __version__

STAGE = "pictures"
VERSION = 1
MODEL_STAGE = "pictures-of-model"
"""Its record stands beside the folder of the photos'."""


@dataclass(frozen=True, eq=False)
class Kept:
    """Pictures of a project, drawn where what they show has changed. common: inputs of all."""

    project: Project
    common: Inputs

    @classmethod
    def of(cls, project: Project) -> Kept:
        """The pictures of the project as it is now."""
        common = {
            **options_inputs(project, VERSION, "render", "develop"),
            "texproj": __version__,
            **file_inputs(project, mesh=project.mesh_path),
        }
        return cls(project, common)

    def photo(
        self, name: str, record: CameraRecord | None, make: Callable[[], str | None]
    ) -> str | None:
        """The picture of a photo as a data URL; None, and not kept, if there is none."""
        project = self.project
        files = {
            "photo": project.photo_path(name),
            "correspondences": project.picks_files(name),
        }
        hidden = (project.load_record(COLOR) or {}).get("occluders", {})
        if name in hidden:
            files["occluder"] = project.occluder_path(name)
        told = [record.status, camera_part(record), record.quality.get("picks")] if record else None
        inputs = {**self.common, **file_inputs(project, **files), "camera": json_hash(told)}
        return self._made((STAGE, name), inputs, str, make)

    def model(
        self,
        cameras: Mapping[str, Camera],
        records: Mapping[str, CameraRecord],
        make: Callable[[], dict[str, Any]],
    ) -> dict[str, Any]:
        """The pictures of the model. cameras: the photos' that it is seen from; records: all."""
        outputs = (self.project.load_record(COLOR) or {}).get("outputs", {})
        files = {name: self.project.out / name for name in outputs}
        registered = [camera_part(r) for r in records.values() if r.registered_camera]
        inputs = {
            **self.common,
            **file_inputs(self.project, **files),
            "photos": json_hash(list(cameras)),
            "cameras": json_hash(registered),
            "up": self.project.settings.output.up,
        }
        made = self._made((MODEL_STAGE, None), inputs, dict, make)
        assert made is not None
        return made

    def _made(
        self, place: tuple[str, str | None], inputs: Inputs, kind: type, make: Callable[[], Any]
    ) -> Any:
        known = self.project.load_record(*place)
        if known and known["inputs"] == inputs and isinstance(known.get("shown"), kind):
            return known["shown"]
        shown = make()
        if shown is not None:
            self.project.save_record(*place, {"inputs": inputs, "shown": shown})
        return shown
