"""Shader files: found, put together, compiled, and spoken of by name when they fail."""

import moderngl
import pytest

from texproj.errors import RenderError
from texproj.render import shaders
from texproj.render.shaders import Program, shader_folder, shader_source

VERTEX = "#version 330 core\nin vec3 p;\nvoid main() { gl_Position = vec4(p, 1.0); }\n"


@pytest.fixture
def ctx():
    with moderngl.create_context(standalone=True, backend="egl") as ctx:
        yield ctx
        assert ctx.error == "GL_NO_ERROR"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A shader folder of our own."""
    (tmp_path / "include").mkdir()
    (tmp_path / "a.vert").write_text(VERTEX)
    monkeypatch.setattr(shaders, "shader_folder", lambda: tmp_path)
    return tmp_path


def test_the_folder_is_the_checkouts():
    """In a checkout the shaders lie beside the package."""
    assert (shader_folder() / "gbuffer.vert").is_file()


def test_pieces_are_put_in_and_lines_counted(folder):
    """`#version` stays first, defines follow, and each line keeps its number in its own file."""
    (folder / "include" / "x.glsl").write_text("float one() {\n  return 1.0;\n}\n")
    (folder / "a.frag").write_text(
        '#version 330 core\n// head\n#include "x.glsl"\nvoid main() {}\n'
    )
    text, files = shader_source("a.frag", {"N": 3})
    assert files == ["a.frag", "include/x.glsl"]
    assert text.splitlines() == [
        "#version 330 core", "#define N 3", "#line 2 0", "// head", "#line 1 1",
        "float one() {", "  return 1.0;", "}", "#line 4 0", "void main() {}",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("include/x.glsl", '#include "y.glsl"\n', r"include/x.glsl includes another"),
        ("a.frag", '#version 330\n#include "z.glsl"\n', r"no shader include/z.glsl"),
        ("a.frag", "void main() {}\n", r"a.frag must begin with #version"),
    ],
)
def test_broken_files_are_named(folder, name, text, message):
    """Nested includes, missing pieces and a missing version are errors that say where."""
    (folder / "a.frag").write_text('#version 330\n#include "x.glsl"\n')
    (folder / name).write_text(text)
    with pytest.raises(RenderError, match=message):
        shader_source("a.frag")


def test_a_misspelt_shader_gets_a_hint():
    """The nearest known name is offered."""
    with pytest.raises(RenderError, match=r"did you mean 'gbuffer.frag'"):
        shader_source("gbufer.frag")


@pytest.mark.parametrize(
    ("broken", "where"), [("a.frag", r"a\.frag:4"), ("include/x.glsl", r"include/x\.glsl:2")]
)
def test_compile_errors_name_file_and_line(folder, ctx, broken, where):
    """A mistake in a file or in a piece of it is reported at its own line."""
    (folder / "include" / "x.glsl").write_text("// piece\nfloat one() { return 1.0; }\n")
    (folder / "a.frag").write_text(
        '#version 330 core\n#include "x.glsl"\nout vec4 c;\nvoid main() { c = vec4(one()); }\n'
    )
    path = folder / broken
    path.write_text(path.read_text().replace("1.0", "nowhere").replace("vec4(one", "vec4(two"))
    with pytest.raises(RenderError, match=where):
        Program(ctx, "a.vert", "a.frag", {})


def test_uniforms_are_checked_against_the_text(folder, ctx):
    """Set and read back; an unknown name is an error with a hint, an unused one is not."""
    (folder / "a.frag").write_text(
        "#version 330 core\nuniform float gain;\nuniform vec3 unused;\nuniform mat3 turn;\n"
        "out vec4 c;\nvoid main() { c = vec4(turn * vec3(gain), 1.0); }\n"
    )
    program = Program(ctx, "a.vert", "a.frag", {})
    program.set(gain=2.5, unused=(1, 2, 3), turn=range(9))
    assert program.gl["gain"].value == 2.5
    assert program.gl["turn"].value == tuple(range(9))
    with pytest.raises(RenderError, match=r"a.vert \+ a.frag has no uniform 'gian'.*'gain'"):
        program.set(gian=1.0)
    program.release()
