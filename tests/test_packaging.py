"""What is installed from the wheel works away from the checkout, shaders included."""

import importlib.util
import json
import os
import re
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest
from make_wheels import PYTHONS, TABLE, dependencies, is_specific, tags

from texproj import doctor

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
    alone = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(line, cwd=cwd, env=alone, capture_output=True, text=True, check=False)
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
    assert "texproj/py.typed" in names
    assert not [name for name in names if name.startswith(("tests", "projects", "docs"))]


def test_every_shader_of_the_installed_package_compiles(python, tmp_path):
    """All programs, with each switch alone and all attachments together."""
    out = run(python, "-c", COMPILE_ALL, cwd=tmp_path)
    assert str(CHECKOUT / "shaders") not in out
    if "no OpenGL" in out:
        pytest.skip(out.strip().splitlines()[-1])
    assert "compiled gbuffer ['LENS']" in out


# --- every Python


def lacking(python: str) -> set[str]:
    """The compiled dependencies that have no wheel for a Python."""
    table = json.loads(TABLE.read_text())
    return {name for name, pythons in table.items() if python not in pythons}


def test_the_table_of_wheels_knows_every_compiled_dependency():
    """What is neither py3-none nor abi3 here stands in tests/wheels.json; what is came as a wheel,
    or is listed as lacking one for this Python.
    """
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    specific = {name for name in dependencies() if is_specific(name)}
    compiled = {name for name in specific if not any("manylinux" in tag for tag in tags(name))}

    assert specific >= {"numpy", "xatlas"}
    assert specific - set(json.loads(TABLE.read_text())) == set(), "python tests/make_wheels.py"
    if sys.platform == "linux":
        assert compiled <= lacking(python)


def test_readme_installs_a_compiler_where_wheels_lack():
    """The first Python that some dependency has no wheel for is the one that README's commands ask
    for; doctor knows the same dependencies.
    """
    text = (CHECKOUT / "README.md").read_text()
    asked = re.findall(r"sys\.version_info >= \((\d+), (\d+)\)", text)
    first = next(python for python in PYTHONS if lacking(python))
    last = {name: PYTHONS.index(f"{a}.{b}") for name, (a, b) in doctor.LAST_WHEELS.items()}

    assert {".".join(python) for python in asked} == {first}
    for number, python in enumerate(PYTHONS):
        assert {name for name in last if last[name] < number} == lacking(python), python


def test_doctor_says_why_a_package_is_missing():
    """A dependency without a wheel names the compiler; others name pip."""
    why = doctor.missing_package("xatlas", (3, 14))

    assert not why.good and "no wheel for Python 3.14" in why.detail
    assert "g++ python3-dev" in why.remedy and "pip install xatlas" in why.remedy
    assert doctor.missing_package("xatlas", (3, 13)).remedy == "pip install xatlas"
    assert doctor.missing_package("numpy", (3, 14)).remedy == "pip install numpy"


# --- types for users


def test_public_names_have_types(tmp_path):
    """mypy, on somebody else's file, knows each public name; none is Any. The examples of
    docs/python.md are such a file.
    """
    import texproj

    page = (CHECKOUT / "docs/python.md").read_text()
    examples = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    lines = [*examples, *(f"reveal_type(texproj.{name})" for name in texproj.__all__)]
    wrong = ["name: int = texproj.Project.open", "texproj.no_such_name"]
    script = tmp_path / "script.py"
    script.write_text("\n".join([*lines, *wrong]) + "\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", CHECKOUT / "pyproject.toml",
         "--cache-dir", CHECKOUT / ".mypy_cache", script],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    revealed = re.findall(r'Revealed type is "(.*)"', done.stdout)

    assert len(revealed) == len(texproj.__all__), done.stdout + done.stderr
    assert [text for text in revealed if text in ("Any", "builtins.object")] == []
    assert done.stdout.count(": error:") == 2, done.stdout


def test_public_names_are_loaded_from_where_their_types_are():
    """The lazy loader and the imports for type checkers say the same."""
    import ast

    import texproj

    tree = ast.parse((CHECKOUT / "texproj/__init__.py").read_text())
    (block,) = [n for n in tree.body if isinstance(n, ast.If) and "TYPE" in ast.dump(n.test)
                and isinstance(n.test, ast.Name)]  # fmt: skip
    typed = {a.name: n.module for n in block.body if isinstance(n, ast.ImportFrom) for a in n.names}

    assert typed == texproj._HOMES
    assert {*typed, "__version__"} == set(texproj.__all__)
    for name in texproj.__all__:
        assert getattr(texproj, name) is not None
