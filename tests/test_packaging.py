"""What is installed from the wheel works away from the checkout, shaders included."""

import importlib.util
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent

COMPILE_ALL = """
import contextlib, re, sys
from pathlib import Path
import texproj
from texproj.options import RenderOptions
from texproj.render import open_renderer
from texproj.render.shaders import Program, shader_folder

folder = shader_folder()
assert Path(texproj.__file__).parent == folder.parent, folder
print("folder", folder)
with open_renderer() as renderer:
    if renderer.fallback_reason:
        print("no OpenGL:", renderer.fallback_reason)
        sys.exit()
    stack = contextlib.ExitStack()
    stack.enter_context(renderer.current())
    for fragment in sorted(folder.glob("*.frag")):
        vertex = fragment.with_suffix(".vert")
        assert vertex.is_file(), f"{fragment.name} has no vertex shader of its name"
        text = fragment.read_text() + vertex.read_text()
        switches = sorted(set(re.findall(r"#ifdef (\\w+)", text)))
        places = [s for s in switches if s.endswith("_AT")]
        others = [s for s in switches if not s.endswith("_AT")]
        each = [{s: i for i, s in enumerate(places)}, {}, *({s: 0} for s in places)]
        for defines in each:
            for more in [{}, *({s: 1} for s in others)]:
                Program(renderer.ctx, vertex.name, fragment.name, defines | more).release()
                print("compiled", fragment.stem, sorted(defines | more))
    stack.close()  # fails if OpenGL has an error to report
"""


def run(*command: object, cwd: Path) -> str:
    line = [str(c) for c in command]
    done = subprocess.run(line, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """The wheel, built from the checkout."""
    out = tmp_path_factory.mktemp("wheel")
    offline = ["--no-isolation"] if importlib.util.find_spec("hatchling") else []
    run(sys.executable, "-m", "build", "--wheel", *offline, "--outdir", out, CHECKOUT, cwd=out)
    (found,) = out.glob("texproj-*.whl")
    return found


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory) -> Path:
    """A fresh environment with the wheel; the dependencies are those of the running one."""
    home = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", "--without-pip", home / "venv", cwd=home)
    python = home / "venv" / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check"]
    run(*pip, "install", "--no-deps", "--no-index", wheel, cwd=home)
    site = run(python, "-c", "import site; print(site.getsitepackages()[0])", cwd=home).strip()
    (Path(site) / "dependencies.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    return python


def test_the_wheel_holds_every_shader_and_no_tests(wheel):
    """File by file what the checkout has."""
    names = set(zipfile.ZipFile(wheel).namelist())
    shaders = {
        f"texproj/{p.relative_to(CHECKOUT)}"
        for p in (CHECKOUT / "shaders").rglob("*")
        if p.is_file()
    }
    assert "texproj/shaders/gbuffer.frag" in shaders
    assert shaders <= names
    assert not [name for name in names if name.startswith(("tests", "projects"))]


def test_every_shader_of_the_installed_package_compiles(python, tmp_path):
    """All programs, with each switch alone and all attachments together."""
    out = run(python, "-c", COMPILE_ALL, cwd=tmp_path)
    assert str(CHECKOUT / "shaders") not in out
    if "no OpenGL" in out:
        pytest.skip(out.strip().splitlines()[-1])
    assert "compiled gbuffer ['LENS']" in out
