"""Write tests/wheels.json: for which Pythons each dependency that is compiled has a wheel.

python tests/make_wheels.py [NAME ...]

Asks the package index, for the platform of Debian 12 and Ubuntu 22.04 and newer. Run it when a
dependency or a Python is new; README's commands and `texproj doctor` follow what it finds.
"""

import json
import subprocess
import sys
import tempfile
import tomllib
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

TABLE = Path(__file__).resolve().parent / "wheels.json"
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
GLIBC = (5, 12, 17, 24, 27, 28, 31, 34, 35)
"""Versions 2.x of the C library that wheels may ask for; Debian 12 has 2.36."""


def dependencies() -> set[str]:
    """The distributions that texproj needs, and those that these need, without extras."""
    project = tomllib.loads((TABLE.parents[1] / "pyproject.toml").read_text())["project"]
    waiting = [*project["dependencies"]]
    found: set[str] = set()
    while waiting:
        needed = Requirement(waiting.pop())
        name = canonicalize_name(needed.name)
        if name not in found and (not needed.marker or needed.marker.evaluate({"extra": ""})):
            found.add(name)
            waiting += distribution(name).requires or ()
    return found


def tags(name: str) -> list[str]:
    """The tags of the installed wheel, such as cp311-cp311-manylinux_2_28_x86_64."""
    lines = (distribution(name).read_text("WHEEL") or "").splitlines()
    return [line.removeprefix("Tag: ") for line in lines if line.startswith("Tag: ")]


def is_specific(name: str) -> bool:
    """Whether another Python needs another wheel: neither py3-none nor abi3."""
    return not any(tag.split("-")[1] in ("none", "abi3") for tag in tags(name))


def has_wheel(name: str, python: str) -> bool:
    """Whether the index has a wheel for that Python."""
    platforms = [f"--platform=manylinux_2_{minor}_x86_64" for minor in GLIBC]
    with tempfile.TemporaryDirectory() as scratch:
        done = subprocess.run(
            [sys.executable, "-m", "pip", "install", "--dry-run", "--quiet", "--no-deps",
             "--ignore-installed", "--only-binary=:all:", f"--python-version={python}",
             f"--target={scratch}", *platforms, name],
            capture_output=True, check=False,
        )  # fmt: skip
    return done.returncode == 0


def main() -> None:
    """Ask for the distributions that are named, or for all."""
    table = json.loads(TABLE.read_text()) if TABLE.is_file() else {}
    specific = sorted(name for name in dependencies() if is_specific(name))
    for name in sys.argv[1:] or specific:
        table[name] = [python for python in PYTHONS if has_wheel(name, python)]
        print(name, *table[name])
    rows = [f' "{name}": {json.dumps(table[name])}' for name in specific if name in table]
    TABLE.write_text("{\n" + ",\n".join(rows) + "\n}\n")


if __name__ == "__main__":
    main()
