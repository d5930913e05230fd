"""Knowledge goes down only: every import is held against the table in docs/architecture.md."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGE = CHECKOUT / "texproj"
SOURCES = sorted(PACKAGE.rglob("*.py"))
PAGE = sorted((PACKAGE / "preview/web/src").glob("*.ts"))
SAME_ROLE = {"register", "search", "view", "verdict", "charts", "texels", "texture", "vertices"}
"""Names that mean the same wherever they stand: a folder's entry, its search, its view of a photo,
its verdict, kinds of what is colored."""

FOR_SEVERAL = {"scene"}
"""Modules of formats/ that read for several formats: trimesh."""


def id_of(path: Path) -> str:
    return path.relative_to(CHECKOUT).as_posix()


@cache
def table() -> dict[str, int]:
    """Folder or module under texproj/, as the table names it: its floor."""
    text = (CHECKOUT / "docs/architecture.md").read_text()
    part = text.split("<!-- layers -->")[1].split("<!-- end of layers -->")[0]
    rows = re.findall(r"^\| (\d+) \| `([\w./]+)` \|", part, re.MULTILINE)
    assert len(rows) == part.count("\n| ") - 1, "a row of the table cannot be read"
    assert len({name for _, name in rows}) == len(rows), "a row stands twice"
    return {name: int(floor) for floor, name in rows}


def row_of(path: Path) -> str:
    """The row of the table that holds a file: the longest that begins its path.

    The `__init__.py` of a folder whose parts have rows of their own counts to the highest of them.
    Raises LookupError for a file without a row.
    """
    name = path.relative_to(PACKAGE).as_posix()
    found = [row for row in table() if name == row or name.startswith(f"{row}/")]
    if found:
        return max(found, key=len)
    inside = f"{Path(name).parent.as_posix()}/"
    parts = [row for row in table() if row.startswith(inside)]
    if path.name != "__init__.py" or not parts:
        raise LookupError(f"{id_of(path)} has no row in the table of docs/architecture.md")
    return max(parts, key=lambda row: table()[row])


def file_of(module: str) -> Path | None:
    """The source file that a dotted name leads to; the name may end in what the file defines."""
    path = CHECKOUT / module.replace(".", "/")
    if path.with_suffix(".py").is_file():
        return path.with_suffix(".py")
    if (path / "__init__.py").is_file():
        return path / "__init__.py"
    return file_of(module.rpartition(".")[0]) if "." in module else None


@cache
def names_imported(path: Path) -> frozenset[str]:
    """Full dotted names of all that a source file imports, also inside functions."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.module and not node.level, f"{id_of(path)}: relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(found)


@cache
def files_imported(path: Path) -> frozenset[Path]:
    """The files of texproj that a source file imports."""
    own = {name for name in names_imported(path) if name.split(".")[0] == "texproj"}
    files = {file_of(name) for name in own}
    assert None not in files, f"{id_of(path)} imports what is not there: {own}"
    return frozenset(file for file in files if file and file != path)


def packages_imported(path: Path) -> set[str]:
    return {name.split(".")[0] for name in names_imported(path)}


@cache
def scripts_imported(path: Path) -> frozenset[Path]:
    """The TypeScript files that one imports, types included."""
    names = re.findall(r"""(?:from|import)\s*\(?\s*["'](\./[\w./-]+\.ts)["']""", path.read_text())
    return frozenset((path.parent / name).resolve() for name in names)


def circles(graph: dict[Path, frozenset[Path]]) -> list[set[str]]:
    """Groups of files of which each reaches each other by imports (Tarjan's components)."""
    order: dict[Path, int] = {}
    low: dict[Path, int] = {}
    stack: list[Path] = []
    found: list[set[str]] = []

    def visit(path: Path) -> None:
        order[path] = low[path] = len(order)
        stack.append(path)
        for other in graph[path]:
            if other not in order:
                visit(other)
                low[path] = min(low[path], low[other])
            elif other in stack:
                low[path] = min(low[path], order[other])
        if low[path] == order[path]:
            group = stack[stack.index(path) :]
            del stack[stack.index(path) :]
            if len(group) > 1:
                found.append({id_of(member) for member in group})

    for path in graph:
        if path not in order:
            visit(path)
    return found


def test_the_table_runs_from_bottom_to_top_and_holds_nothing_that_is_gone():
    """Floors never fall from row to row; each row has its folder or file."""
    floors = list(table().values())

    assert floors == sorted(floors)
    assert [row for row in table() if not (PACKAGE / row).exists()] == []


def test_every_file_has_a_row():
    """Whoever adds a folder or a module says on which floor it stands."""
    lost = []
    for path in SOURCES:
        try:
            row_of(path)
        except LookupError:
            lost.append(id_of(path))

    assert lost == []


def test_imports_go_down():
    """No file imports from a floor above its own, nor from another row of its own floor."""
    wrong = [
        f"{id_of(path)} (floor {table()[own]}) imports {id_of(other)} (floor {table()[row]})"
        for path, own in ((path, row_of(path)) for path in SOURCES)
        for other, row in ((other, row_of(other)) for other in files_imported(path))
        if row != own and table()[row] >= table()[own]
    ]
    assert wrong == []


def test_no_files_import_each_other_in_a_circle():
    """Neither at once nor around others; imports inside functions and for types count too."""
    assert circles({path: files_imported(path) for path in SOURCES}) == []


def test_no_scripts_of_the_page_import_each_other_in_a_circle():
    """The same for the web page's TypeScript."""
    assert len(PAGE) > 20
    assert circles({path: scripts_imported(path) for path in PAGE}) == []


def test_circles_are_found():
    """Two files and three in a ring are; a chain and a diamond are not."""
    a, b, c, d = (PACKAGE / name for name in "abcd")
    none = frozenset()

    assert circles({a: frozenset({b, c}), b: frozenset({d}), c: frozenset({d}), d: none}) == []
    assert circles({a: frozenset({b}), b: frozenset({c}), c: frozenset({a, d}), d: none}) == [
        {id_of(a), id_of(b), id_of(c)}
    ]


def test_one_door_to_opengl():
    """Only `render` knows moderngl."""
    knowing = {row_of(path) for path in SOURCES if "moderngl" in packages_imported(path)}
    assert knowing == {"render"}


@pytest.mark.parametrize("layer", ["solve", "register", "color", "unwrap", "appearance"])
def test_methods_open_no_files(layer):
    """Methods take nouns and give nouns; the project and the formats do files."""
    for path in (PACKAGE / layer).rglob("*.py"):
        rows = {row_of(other) for other in files_imported(path)}
        called = {
            node.func.id
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        }

        assert not {row for row in rows if row.startswith(("formats", "project", "files"))}, path
        assert not packages_imported(path) & {"pathlib", "io", "shutil"}, path
        assert "open" not in called, path


def defines(path: Path, *names: str) -> bool:
    """Whether a file has a function of one of these names."""
    tree = ast.parse(path.read_text())
    return any(isinstance(node, ast.FunctionDef) and node.name in names for node in tree.body)


def test_formats_do_not_know_each_other():
    """A module that reads or writes the format it is named after imports no other such module."""
    formats = {
        path
        for path in (PACKAGE / "formats").rglob("*.py")
        if defines(path, f"read_{path.stem}", f"write_{path.stem}") and path.stem not in FOR_SEVERAL
    }
    assert {"colmap", "metashape", "glb", "obj", "ply", "cameras"} <= {p.stem for p in formats}
    known = {id_of(path): {id_of(p) for p in files_imported(path) & formats} for path in formats}
    assert {name: others for name, others in known.items() if others} == {}


def test_each_name_of_a_module_means_one_thing():
    """No folder of methods has a module of another folder's name, but for the same role."""
    seen: dict[str, Path] = {}
    for layer in ("register", "color", "unwrap", "appearance", "resources"):
        for path in sorted((PACKAGE / layer).rglob("*.py")):
            if path.name != "__init__.py" and path.stem not in SAME_ROLE:
                assert path.stem not in seen, f"{id_of(path)} and {id_of(seen[path.stem])}"
                seen[path.stem] = path
