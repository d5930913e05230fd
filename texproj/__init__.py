"""Color a 3D mesh from loose photographs: registration and color projection, headless.

The stage functions are the Python interface::

    import texproj

    project = texproj.create_project(Path("statue"), Path("scan.ply"), [Path("DCIM")], link=False)
    with texproj.Workbench(project) as bench:
        outcome = texproj.run_project(bench)

docs/python.md tells more.
"""

from typing import TYPE_CHECKING

from texproj.loading import when_used
from texproj.version import __version__

if TYPE_CHECKING:
    from texproj.camera import Camera, Intrinsics, Pose
    from texproj.creation import create_project
    from texproj.errors import TexprojError
    from texproj.mesh import Mesh
    from texproj.photo import Correspondences, Photo
    from texproj.project import Project
    from texproj.stages.appearing import appearance_project
    from texproj.stages.bench import Workbench
    from texproj.stages.coloring import color_project
    from texproj.stages.partners import partners
    from texproj.stages.refining import refine_project
    from texproj.stages.registering import register_photos
    from texproj.stages.reporting import report_project
    from texproj.stages.running import run_project
    from texproj.stages.status import project_status

_HOMES = {
    "Camera": "texproj.camera",
    "Intrinsics": "texproj.camera",
    "Pose": "texproj.camera",
    "Mesh": "texproj.mesh",
    "Photo": "texproj.photo",
    "Correspondences": "texproj.photo",
    "TexprojError": "texproj.errors",
    "Project": "texproj.project",
    "create_project": "texproj.creation",
    "Workbench": "texproj.stages.bench",
    "register_photos": "texproj.stages.registering",
    "partners": "texproj.stages.partners",
    "refine_project": "texproj.stages.refining",
    "appearance_project": "texproj.stages.appearing",
    "color_project": "texproj.stages.coloring",
    "report_project": "texproj.stages.reporting",
    "run_project": "texproj.stages.running",
    "project_status": "texproj.stages.status",
}

__all__ = [
    "Camera",
    "Correspondences",
    "Intrinsics",
    "Mesh",
    "Photo",
    "Pose",
    "Project",
    "TexprojError",
    "Workbench",
    "__version__",
    "appearance_project",
    "color_project",
    "create_project",
    "partners",
    "project_status",
    "refine_project",
    "register_photos",
    "report_project",
    "run_project",
]

if not TYPE_CHECKING:  # else every name would be there, as Any
    __getattr__ = when_used("texproj", _HOMES)  # `import texproj` itself costs nothing
