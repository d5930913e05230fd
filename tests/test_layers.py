"""Knowledge goes down only: each layer imports from the layers below it."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "texproj"

LAYERS = [
    {"errors", "arrays", "resources"},
    {"options"},
    {"camera", "mesh", "photo", "records"},
    {"solve", "render", "formats", "repair", "files", "log"},
    {"unwrap", "register", "color", "report", "demo", "settings"},
    {"intake", "project"},
    {"creation"},
    {"stages", "doctor"},
    {"bundle"},
    {"preview"},
    {"cli", "__init__", "__main__"},
]
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}
SOURCES = sorted(PACKAGE.rglob("*.py"))


def top(path: Path) -> str:
    """The layer's member that a source file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_modules(path: Path) -> set[str]:
    """Full names of all modules that a source file imports, also inside functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_down(path):
    """No module imports from a layer above its own."""
    own = LEVEL[top(path)]
    members = {m.split(".")[1] for m in imported_modules(path) if m.startswith("texproj.")}

    assert {m for m in members if LEVEL.get(m, 0) > own} == set()


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_one_door_to_opengl(path):
    """Only `render` knows moderngl."""
    assert "moderngl" not in imported_modules(path) or top(path) == "render"


@pytest.mark.parametrize("layer", ["solve", "register", "color"])
def test_methods_open_no_files(layer):
    """Methods take nouns and give nouns; the project and the formats do files."""
    for path in (PACKAGE / layer).rglob("*.py"):
        modules = imported_modules(path)

        assert not modules & {"texproj.formats", "texproj.project", "pathlib"}, path


def test_formats_do_not_know_each_other():
    """A format is one module, with no other format in it."""
    formats = PACKAGE / "formats"
    names = {p.stem for p in formats.glob("*.py")} - {"__init__"}
    for path in formats.glob("*.py"):
        used = {m.split(".")[2] for m in imported_modules(path) if m.startswith("texproj.formats.")}

        assert used & names == set(), path
