"""Write the reference of commands and settings into README.md from the program itself.

python tests/make_reference.py
"""

import re
from dataclasses import fields
from pathlib import Path

from pydantic import TypeAdapter

from texproj.cli.commands import app
from texproj.settings import SECTIONS

README = Path(__file__).resolve().parent.parent / "README.md"
MARKERS = {
    "commands": ("<!-- commands -->", "<!-- end of commands -->"),
    "settings": ("<!-- settings -->", "<!-- end of settings -->"),
}


def commands() -> str:
    """A table of the commands: what each does, and its example."""
    lines = ["| command | what it does |", "|---|---|"]
    for name in command_names():
        text = app[name].help or ""
        first = text.split("\n\n")[0].replace("\n", " ").strip()
        example = re.search(r"Example: (.*)", text)
        lines.append(f"| `{example.group(1).strip()}` | {first} |")
    return "\n".join(lines)


def command_names() -> list[str]:
    """The commands in the order of the program."""
    return [name for name in app if not name.startswith("-")]


def settings() -> str:
    """A table of all settings: table of project.toml, key, default, meaning."""
    lines = ["| table | key | default | meaning |", "|---|---|---|---|"]
    for section, cls in SECTIONS.items():
        described = TypeAdapter(cls).json_schema()["properties"]
        for option in fields(cls):
            text = " ".join(described[option.name]["description"].split()).replace("|", "\\|")
            default = str(option.default).replace("|", "\\|")
            lines.append(f"| [{section}] | {option.name} | {default} | {text} |")
    return "\n".join(lines)


def updated(text: str) -> str:
    """README's text with both tables made anew."""
    for name, make in (("commands", commands), ("settings", settings)):
        start, end = MARKERS[name]
        before, rest = text.split(start)
        _, after = rest.split(end)
        text = f"{before}{start}\n{make()}\n{end}{after}"
    return text


if __name__ == "__main__":
    README.write_text(updated(README.read_text()))
