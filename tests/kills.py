"""Kill a run at every place where it renames a file, then let the next one finish.

    python tests/kills.py PROJECT [--moments 40]

Makes copies of PROJECT, a small one. Each copy's `texproj run` is killed at its first, second, ...
rename; `--moments` also kills as many runs at random moments. After each kill the next run must
end well, leave no temporary file, have registered the same photos, and leave nothing stale: every
file of the model is the one that the records tell of.
Prints one line for each kill that did harm, and the count.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from texproj.project import Project
from texproj.stages.status import project_status

KILLED = 9
SCRIPT = """
import os, sys
from pathlib import Path
left = [int(sys.argv[1])]
rename = Path.replace
def counted(self, target):
    left[0] -= 1
    if left[0] == 0:
        os._exit(9)
    return rename(self, target)
Path.replace = counted
from texproj.cli import main
from texproj.report import pictures
pictures.VIEW_SIZE = (160, 120)  # what is killed is writing, not drawing
code = main(["run", sys.argv[2]])
print("renames", int(sys.argv[1]) - left[0])
sys.exit(code)
"""


def run(project: Path, kill_at: int = 10**9) -> subprocess.CompletedProcess[str]:
    """`texproj run` that is killed instead of renaming for the `kill_at`-th time."""
    words = [sys.executable, "-c", SCRIPT, str(kill_at), str(project)]
    return subprocess.run(words, capture_output=True, text=True, check=False)


def run_for(project: Path, seconds: float) -> None:
    """`texproj run` that is killed after some time."""
    words = [sys.executable, "-m", "texproj", "run", str(project)]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        time.sleep(seconds)
        process.kill()


def result(project: Path) -> dict[str, str]:
    """What is known of each photo, and what is stale of the results."""
    opened = Project.open(project)
    stale = {str(item.item): item.reason for item in project_status(opened) if not item.fresh}
    return {name: record.status for name, record in opened.load_cameras().items()} | stale


def temporary(project: Path) -> list[str]:
    """Files and folders that a write left unfinished."""
    return [str(p.relative_to(project)) for p in project.rglob(".unfinished-*")]


def harm(project: Path, right: dict[str, str]) -> str:
    """What a kill did to a project, after the next run; empty if nothing."""
    path = project / "cameras.json"
    if path.exists():
        json.loads(path.read_text())  # whole or absent, never half
    after = run(project)
    if after.returncode not in (0, 1):
        return f"the next run ends with {after.returncode}: {after.stderr.strip()[-300:]}"
    if temporary(project):
        return f"left: {', '.join(temporary(project))}"
    made = result(project)
    return f"{made} in place of {right}" if made != right else ""


def age(project: Path) -> None:
    """Temporary folders that nobody has claimed yet count as left only after some seconds."""
    for folder in project.rglob(".unfinished-*"):
        os.utime(folder, (0, 0))


def main() -> None:
    """Kill and look."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("project", type=Path)
    parser.add_argument("--moments", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(shutil.copytree(options.project, Path(folder) / "whole"))
        start = time.monotonic()
        count = int(run(whole).stdout.split()[-1])
        lasted, right = time.monotonic() - start, result(whole)
        random.seed(0)
        kills = [lambda p, k=k: run(p, k) for k in range(1, count + 1)]
        moments = [random.uniform(0, lasted) for _ in range(options.moments)]
        kills += [lambda p, s=s: run_for(p, s) for s in moments]
        bad = 0
        for number, kill in enumerate(kills):
            copy = Path(shutil.copytree(options.project, Path(folder) / str(number)))
            kill(copy)
            age(copy)
            told = harm(copy, right)
            bad += bool(told)
            if told:
                print(f"kill {number + 1}: {told}", flush=True)
            shutil.rmtree(copy)
        print(f"{len(kills)} kills ({count} renames), {bad} did harm")


if __name__ == "__main__":
    main()
