"""Other programs that color a mesh from photos at known cameras: which are there, and how to run
them on a project.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from color_runs import Run, timed

HERE = Path(__file__).resolve().parent
ON_PATH = {
    "mvs-texturing": "texrecon",
    "OpenMVS": "TextureMesh",
    "COLMAP": "colmap",
    "Meshroom": "meshroom_batch",
    "Metashape": "metashape",
    "RealityScan": "RealityScan",
}
"""Programs that are only looked for: they take cameras in formats of their own."""


@dataclass(frozen=True)
class Result:
    """What a peer did: its model, or why there is none."""

    name: str
    run: Run
    model: Path | None


def missing() -> str:
    """A sentence on the programs that are only looked for."""
    found = [f"{name} ({program})" for name, program in ON_PATH.items() if shutil.which(program)]
    absent = [name for name in ON_PATH if not shutil.which(ON_PATH[name])]
    words = [f"not installed: {', '.join(absent)}"] if absent else []
    words += [f"installed, but not run here: {', '.join(found)}"] if found else []
    return "; ".join(words)


def open3d_python(given: str | None) -> str | None:
    """An interpreter that has Open3D: the one given, or this one."""
    python = given or sys.executable
    if given is None and importlib.util.find_spec("open3d") is None:
        return None
    found = subprocess.run([python, "-c", "import open3d"], capture_output=True, check=False)
    return python if found.returncode == 0 else None


def peers(project: Path, folder: Path, open3d: str | None) -> Iterator[Result]:
    """Run the peers on a project that has been textured (out/model.obj); models go to folder."""
    folder.mkdir(parents=True, exist_ok=True)
    yield _pymeshlab(project, folder / "pymeshlab.ply")
    if open3d is None:
        nothing = Run(0, 0, 0, "not installed (pip install open3d, --python-open3d PYTHON)")
        yield Result("Open3D", nothing, None)
        return
    script = [open3d, HERE / "peer_open3d.py", project]
    out = folder / "open3d.ply"
    yield _result("Open3D color map", timed([*script, "vertices", out]), out)
    out = folder / "open3d.obj"
    run = timed([*script, "albedo", out, project / "out/model.obj"])
    yield _result("Open3D albedo", run, out)


def _pymeshlab(project: Path, out: Path) -> Result:
    """With a virtual display if there is one: the filter needs a Qt platform."""
    export = [sys.executable, "-m", "texproj", "export", project, "--format", "meshlab"]
    subprocess.run([str(p) for p in export], check=True, capture_output=True)
    display = ["xvfb-run", "-a"] if shutil.which("xvfb-run") else []
    run = timed([*display, sys.executable, HERE / "peer_pymeshlab.py", project, out])
    if run.failure:
        why = "its raster filter stops without Qt's platform plugins and a display"
        run = replace(run, failure=f"{why} (last words: {run.failure})")
    return _result("PyMeshLab vertices", run, out)


def _result(name: str, run: Run, out: Path) -> Result:
    return Result(name, run, out if not run.failure and out.exists() else None)
