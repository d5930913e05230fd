"""Node and the page's packages, as the tests of the page need them."""

import importlib.util
import json
import os
import subprocess
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
WEB = CHECKOUT / "texproj/preview/web"
UNREACHABLE = ("ENOTFOUND", "EAI_AGAIN", "ETIMEDOUT", "ECONNREFUSED", "ECONNRESET", "ENETUNREACH")


def builder():
    """The module hatch_build of the checkout."""
    spec = importlib.util.spec_from_file_location("hatch_build", CHECKOUT / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def with_packages():
    """The command of node, once the page's packages are there as locked, those for tests too.

    Skips the test where there is no node, or npm cannot reach its registry.
    """
    try:
        node, npm = builder().node_commands()
    except ImportError:
        pytest.skip("no node: pip install '.[test]' brings one")
    if not installed():
        done = run([*npm, "ci", "--ignore-scripts", "--no-audit", "--no-fund"], node)
        if done.returncode and any(word in done.stdout for word in UNREACHABLE):
            pytest.skip("npm cannot reach its registry, so the page's packages are not there")
        assert done.returncode == 0, done.stdout
    return node


def installed():
    """Whether node_modules holds the packages of the lock file."""
    try:
        kept = json.loads((WEB / "node_modules/.package-lock.json").read_text())["packages"]
    except OSError:
        return False
    wanted = json.loads((WEB / "package-lock.json").read_text())["packages"]
    known = {name: entry["version"] for name, entry in kept.items()}
    needed = {n: e["version"] for n, e in wanted.items() if n and not e.get("optional")}
    return needed.items() <= known.items()


def run(command, node):
    """A command in the page's folder; what it says, errors too, is its stdout."""
    path = os.pathsep.join([str(Path(node[0]).parent), os.environ.get("PATH", "")])
    return subprocess.run(
        command, cwd=WEB, env={**os.environ, "PATH": path}, text=True, timeout=300, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
