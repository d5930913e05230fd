"""How the scan stands, and from where it is looked at, for pictures of it."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

from texproj.camera import Camera
from texproj.errors import InputError, UsageError
from texproj.mesh import Mesh
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.report.pictures import Front, front_of
from texproj.standing import Measured, standing


def front(project: Project, mesh: Mesh) -> Front:
    """Upward as the model has it, towards where most photos were taken."""
    known = _registered(project.load_cameras().values())
    cameras = tuple(known.values())
    output = project.settings.output
    measured = [_measured(project, name) for name in known]
    return front_of(mesh, cameras, standing(output.up, output.unit, cameras, measured).up)


def _registered(records: Iterable[CameraRecord]) -> dict[str, Camera]:
    return {r.file: camera for r in records if (camera := r.registered_camera) is not None}


def _measured(project: Project, name: str) -> Measured:
    """What was upward in the camera's axes; empty where the photo does not tell it."""
    with suppress(InputError, UsageError):  # the photo is broken, or not there any more
        return project.photo_info(name).up_in_cam
    return ()
