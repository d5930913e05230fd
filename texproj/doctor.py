"""What this machine offers, what is missing and how to get it."""

from __future__ import annotations

import ctypes
import os
import platform
import sys
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, requires, version
from re import match

from texproj.errors import RenderError
from texproj.options import RenderOptions
from texproj.render import open_renderer

GL_LIBRARIES = {"libEGL.so.1": "libegl1", "libGL.so.1": "libgl1", "libOpenGL.so.0": "libopengl0"}
"""Shared libraries that OpenGL without a display and pymeshlab need, and their Debian packages."""

LAST_WHEELS = {"xatlas": (3, 13)}
"""Dependencies that come as source for newer Pythons than this, and need a compiler there."""

OPTIONAL = {
    "pillow-heif": "HEIC photos",
    "meshopt": "meshes compressed by meshopt (gltfpack)",
    "mitsuba": "path-traced pictures of relight",
}
"""Packages that only some people need, and what for."""

COMPILER = "apt-get install --no-install-recommends g++ python3-dev"


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at. remedy: what to do if it is not good."""

    name: str
    good: bool
    detail: str
    remedy: str = ""


def examine() -> list[Finding]:
    """Look at the machine: system, renderers, system libraries, packages."""
    system = f"Python {platform.python_version()} on {platform.platform()}, {os.cpu_count()} cores"
    return [Finding("system", True, system), *_libraries(), *_renderers(), *_packages(), *_extras()]


def missing_package(name: str, python: tuple[int, int] = sys.version_info[:2]) -> Finding:
    """What to say of a package that is not installed: why it may lack, and how to get it."""
    newest = LAST_WHEELS.get(name)
    if newest is None or python <= newest:
        return Finding(name, False, "not installed", f"pip install {name}")
    why = f"not installed: it has no wheel for Python {python[0]}.{python[1]} and must be compiled"
    return Finding(name, False, why, f"{COMPILER}, then: pip install {name}")


def _libraries() -> list[Finding]:
    if platform.system() != "Linux":
        return []
    missing = [name for name in GL_LIBRARIES if not _loads(name)]
    if not missing:
        return [Finding("libraries", True, ", ".join(GL_LIBRARIES))]
    packages = " ".join(GL_LIBRARIES[name] for name in missing)
    remedy = f"apt-get install --no-install-recommends {packages}"
    return [Finding("libraries", False, f"{', '.join(missing)} not found", remedy)]


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _renderers() -> list[Finding]:
    findings = []
    for kind in ("gl", "cpu"):
        try:
            with open_renderer(RenderOptions(renderer=kind)) as renderer:
                findings.append(Finding(f"renderer {kind}", True, renderer.name))
        except RenderError as error:
            findings.append(Finding(f"renderer {kind}", False, str(error)))
    return findings


def _extras() -> list[Finding]:
    """Packages of the extras: that one is absent is no fault."""
    findings = []
    for name, purpose in OPTIONAL.items():
        try:
            findings.append(Finding(name, True, f"{version(name)} ({purpose})"))
        except PackageNotFoundError:
            told = f"not installed, needed only for {purpose}: pip install {name}"
            findings.append(Finding(name, True, told))
    return findings


def _packages() -> list[Finding]:
    findings = []
    try:
        needed = requires("texproj") or []
    except PackageNotFoundError:
        remedy = "pip install . (in the checkout)"
        return [Finding("texproj", False, "runs from a checkout, not installed", remedy)]
    for requirement in needed:
        if "extra ==" in requirement:
            continue
        found = match(r"[A-Za-z0-9_.-]+", requirement)
        name = found.group() if found else requirement
        try:
            findings.append(Finding(name, True, version(name)))
        except PackageNotFoundError:
            finding = missing_package(name)
            if ";" in requirement:
                limit = f"{finding.remedy}, where there is a package for this system"
                finding = replace(finding, remedy=limit)
            findings.append(finding)
    return findings
