"""Write the reference of commands (README.md) and settings (docs/settings.md) from the program, and
README's figures from docs/benchmarks.md.

python tests/make_reference.py
"""

import re
import textwrap
from collections.abc import Iterable
from dataclasses import Field, fields
from pathlib import Path
from typing import Any

from kept_figures import KEPT, headline

from texproj.cli.commands import app
from texproj.formats.interchange import FORMATS
from texproj.formats.meshes import MESH_KINDS
from texproj.formats.models import MODEL_KINDS
from texproj.formats.photos import KINDS, PIXELS
from texproj.options import is_expert, meanings
from texproj.settings import SECTIONS

CHECKOUT = Path(__file__).resolve().parent.parent
WIDTH = 100
MOST_ENDINGS = 8
"""Of files' names that a table lists."""


def commands() -> str:
    """A table of the commands: what each does."""
    lines = ["| `texproj ...` | what it does |", "|---|---|"]
    for name in command_names():
        first = (app[name].help or "").split("\n\n")[0].replace("\n", " ").strip()
        lines.append(f"| `{name}` | {first} |")
    return "\n".join(lines)


def command_names() -> list[str]:
    """The commands in the order of the program."""
    return [name for name in app if not name.startswith("-")]


def settings() -> str:
    """All settings that have a flag: by table of project.toml, with defaults and meanings."""
    return _listed(lambda cls, option: not is_expert(cls, option.name))


def expert_settings() -> str:
    """The settings that only project.toml takes."""
    return _listed(lambda cls, option: is_expert(cls, option.name))


def _listed(shown: Any) -> str:
    parts = []
    for section, cls in SECTIONS.items():
        options = [option for option in fields(cls) if shown(cls, option)]
        entries = [_entry(option, meanings(cls)[option.name]) for option in options]
        if entries:
            purpose = " ".join((cls.__doc__ or "").split())
            parts.append("\n".join([f"### [{section}]", purpose, "", *entries]))
    return "\n\n".join(parts)


def _entry(option: Field[Any], meaning: str) -> str:
    text = f"- `{option.name} = {_toml(option.default)}`: {meaning}"
    return textwrap.fill(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False)


def _toml(value: Any) -> str:
    """A default as project.toml would say it."""
    if value is None:
        return "(none)"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else str(value)


def camera_formats() -> str:
    """A table of the formats in which cameras come and go."""
    head = ("`--format`", "programs", "files", "import", "export", "read by")
    rows = (
        (f"`{form.name}`", form.programs, form.files,
         *("yes" if way else "" for way in (form.read, form.write)), form.accepted)
        for form in FORMATS
    )  # fmt: skip
    return _table(head, rows)


def photo_kinds() -> str:
    """A table of the kinds of photos."""
    rows = ((kind, _endings(KINDS[kind]), *PIXELS[kind]) for kind in KINDS)
    return _table(("photos", "endings", "what is read", "by"), rows)


def mesh_kinds() -> str:
    """A table of the kinds of meshes."""
    rows = ((kind.name, " ".join(kind.suffixes), kind.brings, kind.tried) for kind in MESH_KINDS)
    return _table(("meshes", "endings", "what is taken", "files of the tests by"), rows)


def model_kinds() -> str:
    """A table of the models that are written."""
    rows = ((f"`{k.name}`", k.files, k.made_from, k.colors, k.accepted) for k in MODEL_KINDS)
    return _table(("`models`", "files", "made from", "colors", "read by"), rows)


def figures() -> str:
    """A table of what two real scenes came to."""
    head = ("scene", "registered", "off, median / worst", "photos left out", "processor s", "MB")
    return _table(head, headline(KEPT.read_text()))


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [f"| {' | '.join(cells)} |".replace("|  |", "| |") for cells in (head, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])


def _endings(suffixes: tuple[str, ...]) -> str:
    more = len(suffixes) - MOST_ENDINGS
    told = " ".join(suffixes[:MOST_ENDINGS])
    return f"{told} and {more} more" if more > 0 else told


GENERATED = {
    "README.md": {"commands": commands, "figures": figures},
    "docs/files.md": {
        "photos": photo_kinds,
        "meshes": mesh_kinds,
        "camera formats": camera_formats,
        "models": model_kinds,
    },
    "docs/settings.md": {"settings": settings, "expert settings": expert_settings},
}
"""What stands between `<!-- name -->` and `<!-- end of name -->` in which file."""


def updated(name: str, text: str) -> str:
    """The text of a file with its parts made anew."""
    for part, make in GENERATED[name].items():
        start, end = f"<!-- {part} -->", f"<!-- end of {part} -->"
        text = re.sub(f"{start}.*{end}", lambda _, m=make, s=start, e=end: f"{s}\n{m()}\n{e}", text,
                      flags=re.DOTALL)  # fmt: skip
    return text


if __name__ == "__main__":
    for file in GENERATED:
        path = CHECKOUT / file
        path.write_text(updated(file, path.read_text()))
