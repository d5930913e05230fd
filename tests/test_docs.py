"""What the documents say is what the program does."""

import ast
import contextlib
import re
import shlex
import shutil
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest
from cyclopts import MissingArgumentError
from make_reference import GENERATED, updated

CHECKOUT = Path(__file__).resolve().parent.parent
README = CHECKOUT / "README.md"
PAGES = [*sorted(CHECKOUT.glob("*.md")), *sorted(CHECKOUT.glob("docs/*.md"))]
PAGES += [CHECKOUT / "projects/README.md"]


def id_of(path: Path) -> str:
    return path.relative_to(CHECKOUT).as_posix()


def blocks(path: Path, kind: str) -> list[str]:
    """The code blocks of one kind on a page."""
    return re.findall(rf"^```{kind}\n(.*?)^```", path.read_text(), re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("path", PAGES, ids=id_of)
def test_no_line_is_longer_than_100_characters(path):
    """So that it can be read beside something else."""
    lines = path.read_text().splitlines()
    assert [f"line {n + 1}: {len(x)}" for n, x in enumerate(lines) if len(x) > 100] == []


def test_readme_is_of_a_screen_and_a_half():
    """What is longer has a page of its own."""
    assert len(README.read_text().splitlines()) <= 160


@pytest.mark.parametrize("path", PAGES, ids=id_of)
def test_links_lead_somewhere(path):
    """Pages, pictures and the anchors of headings exist."""
    for target in re.findall(r"\]\(([^)]+)\)", path.read_text()):
        name, _, anchor = target.partition("#")
        there = (path.parent / name) if name else path
        assert there.exists(), target
        if anchor:
            titles = re.findall(r"^#+ (.*)", there.read_text(), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w -]", "", t.lower()).replace(" ", "-") for t in titles}


def test_every_page_is_linked_from_readme():
    """Nothing is written that nobody finds."""
    linked = set(re.findall(r"\]\((docs/[\w-]+\.md)\)", README.read_text()))
    assert {id_of(path) for path in PAGES if path.parent.name == "docs"} == linked


@pytest.mark.parametrize("name", sorted(GENERATED))
def test_reference_is_what_the_program_says(name):
    """Commands, settings and their defaults stand there as they are."""
    text = (CHECKOUT / name).read_text()

    assert updated(name, text) == text, "run `python tests/make_reference.py`"
    for part in GENERATED[name]:
        assert f"<!-- {part} -->\n" in text


def test_few_settings_are_there():
    """At most 45 that have a flag: what nobody would set is a constant."""
    text = (CHECKOUT / "docs/settings.md").read_text()
    shown = text.split("<!-- settings -->")[1].split("<!-- end of settings -->")[0]
    assert 10 < shown.count("\n- `") <= 45


def parse(line: str) -> None:
    """Raise what the command line would complain of."""
    from texproj.cli.commands import app

    words = shlex.split(line)
    if words[:1] == ["texproj"] and "..." not in line and "COMMAND" not in line:
        app.parse_args(words[1:], print_error=False, exit_on_error=False)


def test_keys_at_the_top_of_project_toml_are_told():
    """Those that belong to no table have no generated text: each is named, its example holds."""
    from texproj.settings import SECTIONS, Settings, read_settings

    text = (CHECKOUT / "docs/settings.md").read_text().split("<!-- settings -->")[0]
    said = dict(re.findall(r"^- `((\w+) = .*)`:", text, re.MULTILINE))
    tables = {name.replace("-", "_") for name in SECTIONS}
    keys = {field.name for field in fields(Settings) if field.metadata.get("key", True)} - tables

    assert set(said.values()) == keys
    settings = read_settings("\n".join(said), "docs/settings.md")
    assert settings.photos == Settings().photos
    assert settings.largest_photo_mp == Settings().largest_photo_mp


@pytest.mark.parametrize("path", PAGES, ids=id_of)
def test_commands_can_be_typed_as_they_stand(path):
    """Each `texproj` line of a shell block parses, and so does what a sentence quotes, though there
    the project may go without saying.
    """
    shell = "\n".join(blocks(path, "sh")).replace("&&", "\n").splitlines()
    for line in shell:
        parse(line.split("#")[0].strip())
    for line in re.findall(r"`(texproj [^`]+)`", path.read_text().replace("\n", " ")):
        with contextlib.suppress(MissingArgumentError):
            parse(line)


def test_every_dependency_has_its_reason():
    """The table of libraries and pyproject.toml name the same."""
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    needed = {re.split(r"[>=;\s]", text)[0] for text in project["dependencies"]}
    part = (CHECKOUT / "docs/architecture.md").read_text().split("## Why these libraries")[1]
    told = re.findall(r"^\| ([a-z0-9, -]+?)(?: \(.*\))? \|", part, re.MULTILINE)

    assert needed == {name for row in told for name in row.split(", ")} - {"library"}


def test_both_commands_install_in_the_same_way():
    """What the tests need besides is pip's affair."""
    text = README.read_text()
    demo, tests = (
        text.split(f"<!-- {name} command -->\n```sh\n")[1].split("```")[0]
        for name in ("demo", "test")
    )
    until = "pip install"

    assert demo.split(until)[0] == tests.split(until)[0]
    assert demo.endswith("pip install . && texproj demo\n")
    assert tests.endswith("ruff check . && mypy && python -m pytest\n")


def test_the_newest_version_of_the_changelog_is_the_program_s():
    """Each version has its date, newest first."""
    text = (CHECKOUT / "CHANGELOG.md").read_text()
    versions = re.findall(r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)$", text, re.MULTILINE)
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]

    assert len(versions) == len(re.findall(r"^## \[\d", text, re.MULTILINE))
    assert versions[0][0] == project["version"]
    assert [date for _, date in versions] == sorted((d for _, d in versions), reverse=True)


def test_python_page_runs(stele, tmp_path, monkeypatch, capsys):
    """Its blocks, one after the other, on the sample project after a run."""
    shutil.copytree(stele, tmp_path / "stele")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks(CHECKOUT / "docs/python.md", "python"):
        exec(compile(ast.parse(block), "docs/python.md", "exec"), names)
    said = capsys.readouterr().out

    assert "IMG_0003.jpg points" in said
    assert "written: ('model.ply',)" in said


def test_python_page_names_all_that_is_public():
    """Nothing that can be imported goes unsaid."""
    import texproj

    text = (CHECKOUT / "docs/python.md").read_text()
    assert {n for n in texproj.__all__ if not re.search(rf"\b{n}\b", text)} == {"__version__"}
