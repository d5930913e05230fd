"""Color a 3D mesh from loose photographs: registration and color projection, headless.

The stage functions are the Python interface::

    import texproj

    project = texproj.create_project(Path("statue"), Path("scan.ply"), [Path("DCIM")], link=False)
    with texproj.Workbench(project) as bench:
        outcome = texproj.run_project(bench)
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

try:
    __version__ = version("texproj")
except PackageNotFoundError:  # a bare checkout
    __version__ = "0+checkout"

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
    "refine_project": "texproj.stages.refining",
    "color_project": "texproj.stages.coloring",
    "report_project": "texproj.stages.reporting",
    "run_project": "texproj.stages.running",
    "project_status": "texproj.stages.running",
}

__all__ = ["__version__", *_HOMES]  # noqa: PLE0604 - names, loaded when asked for


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used: `import texproj` itself costs nothing."""
    if name not in _HOMES:
        raise AttributeError(f"module 'texproj' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
