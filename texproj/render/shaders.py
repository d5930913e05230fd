"""Shader files: where they are, what they include, how they become programs.

A shader may include pieces of `include/`, which include nothing themselves. Line directives keep
the compiler's messages at the file's own lines.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from texproj.errors import RenderError, nearest_name

BINDINGS = {"Camera": 0, "Lens": 1}
"""Binding point of each uniform block of `include/`."""

KNOWN_FILE = "gbuffer.vert"
"""A folder counts as the shader folder only if it holds this file."""

INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')
UNIFORM = re.compile(r"\buniform\s+\w+\s+(\w+)")
LOCATION = re.compile(r"\b(\d+)(?=:\d+\()|\b(\d+)\(\d+\)\s*:")


@cache
def shader_folder() -> Path:
    """The folder of the shaders: inside the installed package, or in the checkout beside it."""
    package = Path(__file__).resolve().parent.parent
    for folder in (package / "shaders", package.parent / "shaders"):
        if (folder / KNOWN_FILE).is_file():
            return folder
    raise RenderError(f"The shaders are missing from {package}; install texproj again.")


def shader_source(name: str, defines: dict[str, int] | None = None) -> tuple[str, list[str]]:
    """The text of shader `name`, includes and defines put in, and the files that `#line` counts.

    Raises RenderError for a missing file, an include inside an include, or a missing `#version`.
    """
    files = [name]
    lines = _read(name).splitlines()
    if not lines or not lines[0].startswith("#version"):
        raise RenderError(f"Shader {name} must begin with #version.")
    out = [lines[0], *(f"#define {key} {value}" for key, value in (defines or {}).items())]
    out.append("#line 2 0")
    for number, line in enumerate(lines[1:], start=2):
        match = INCLUDE.match(line)
        if match is None:
            out.append(line)
            continue
        files.append(f"include/{match[1]}")
        piece = _included(files[-1])
        out += [f"#line 1 {len(files) - 1}", *piece, f"#line {number + 1} 0"]
    return "\n".join(out) + "\n", files


def _included(name: str) -> list[str]:
    lines = _read(name).splitlines()
    nested = next((line for line in lines if INCLUDE.match(line)), None)
    if nested:
        raise RenderError(
            f"Shader piece {name} includes another ({nested.strip()}): one level only."
        )
    return lines


def _read(name: str) -> str:
    path = shader_folder() / name
    if not path.is_file():
        known = [str(p.relative_to(shader_folder())) for p in shader_folder().rglob("*.*")]
        raise RenderError(f"There is no shader {name}{nearest_name(name, known)}")
    return path.read_text(encoding="utf-8")


class Program:
    """A compiled pair of shaders that knows which uniforms its text declares."""

    def __init__(
        self, ctx: moderngl.Context, vertex: str, fragment: str, defines: dict[str, int]
    ) -> None:
        vertex_text, vertex_files = shader_source(vertex, defines)
        fragment_text, fragment_files = shader_source(fragment, defines)
        self.names = frozenset(UNIFORM.findall(vertex_text + fragment_text))
        self.label = f"{vertex} + {fragment}"
        try:
            self.gl: Any = ctx.program(vertex_shader=vertex_text, fragment_shader=fragment_text)
        except moderngl.Error as error:
            files = fragment_files if "fragment_shader" in str(error) else vertex_files
            raise RenderError(_with_files(str(error), files)) from None
        for block, binding in BINDINGS.items():
            if block in self.gl:
                member: Any = self.gl[block]
                member.binding = binding

    def release(self) -> None:
        """Give the program back."""
        self.gl.release()

    def set(self, **values: ArrayLike) -> None:
        """Set uniforms by name. A name that the text does not declare is an error; one that the
        compiler optimised away is not.
        """
        for name, value in values.items():
            if name not in self.names:
                hint = nearest_name(name, self.names)
                raise RenderError(f"{self.label} has no uniform {name!r}{hint}")
            if name in self.gl:
                array = np.asarray(value)
                self.gl[name].value = array.item() if array.ndim == 0 else tuple(array.ravel())


def _with_files(message: str, files: list[str]) -> str:
    """Put file names in place of the numbers that `#line` gave them (``0:12(5):`` in Mesa)."""

    def named(match: re.Match[str]) -> str:
        number = int(match[1] or match[2])
        return files[number] if number < len(files) else match[0]

    return re.sub(LOCATION, named, message)
