"""Projects of real scenes at their reference cameras, programs run and timed on them, and their
models compared with the photos left out.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
HELD_OUT = {"sceaux-castle": ("00003", "00006"), "fountain-P11": ("0003", "0007")}
MODEL = {"vertices": "model.ply", "texture": "model.obj", "patches": "model.obj"}


@dataclass(frozen=True)
class Run:
    """A program that ran: seconds, processor seconds, peak megabytes; failure: what it said, empty
    if all is well.
    """

    seconds: float
    cpu: float
    megabytes: float
    failure: str = ""

    def __str__(self) -> str:
        return f"{self.seconds:7.1f} {self.cpu:7.1f} {self.megabytes:6.0f}"


def make_project(
    data: Path, project: Path, every: bool = False, mesh: str = "mesh.ply", times: int = 1
) -> None:
    """A project at the reference cameras, of the photos that are not held out (or of all); `times`
    repeats the list of photos under other names.
    """
    if project.exists():
        shutil.rmtree(project)
    (project / "mesh").mkdir(parents=True)
    (project / "photos").mkdir()
    (project / "mesh" / Path(mesh).name).symlink_to((data / mesh).resolve())
    (project / "project.toml").touch()
    cameras = json.loads((data / "cameras_reference.json").read_text())
    held = () if every else HELD_OUT[data.name]
    chosen = [p for p in cameras["photos"] if Path(p["file"]).stem not in held]
    cameras["photos"] = [
        dict(p, file=f"r{k}_{p['file']}" if k else p["file"]) for k in range(times) for p in chosen
    ]
    for photo, source in zip(cameras["photos"], chosen * times, strict=True):
        original = (data / "photos" / source["file"]).resolve()
        (project / "photos" / photo["file"]).symlink_to(original)
    (project / "cameras.json").write_text(json.dumps(cameras))


TIMER = """
import json, os, subprocess, sys, time
start = time.monotonic()
process = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                           stderr=subprocess.PIPE)
said = process.stderr.read().decode(errors="replace").strip().splitlines()
_, status, used = os.wait4(process.pid, 0)
why = (said or [""])[-1].strip() or f"ended with status {status}"
print(json.dumps([time.monotonic() - start, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024,
                  why if status else ""]))
"""
"""Starts a program and measures it. In an interpreter of its own, since Linux counts the memory of
whoever starts a program as the program's own peak."""


def timed(command: list[str | Path]) -> Run:
    """Run a program to its end."""
    wrapped = [sys.executable, "-I", "-S", "-c", TIMER, *map(str, command)]
    done = subprocess.run(wrapped, cwd=CHECKOUT, capture_output=True, text=True, check=True)
    return Run(*json.loads(done.stdout))


def color(project: Path, kind: str) -> Run:
    """`texproj color`, the whole command. Raises SystemExit if it fails."""
    command = [sys.executable, "-m", "texproj", "color", project, "--to", kind]
    run = timed(command)
    if run.failure:
        raise SystemExit(f"texproj color {project} --to {kind}: {run.failure}")
    return run


def compared(data: Path, model: Path, script: Path) -> dict[str, float]:
    """The script's means over the held-out photos: `seen`, and what it measures within all that
    some photo sees after a gain and offset per channel.
    """
    out = model.with_suffix(".rephoto.json")
    command = [sys.executable, script, model, data / "cameras_reference.json", "--photos",
               data / "photos", "--held-out", ",".join(HELD_OUT[data.name]),
               "--reference-mesh", data / "mesh.ply", "--out", out]  # fmt: skip
    if (data / "eval_masks").is_dir():
        command += ["--masks", data / "eval_masks"]
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
    mean = json.loads(out.read_text())["mean"]
    return {"seen": mean["coverage"]["of_seen"], **mean["within_seen"]["affine"]}
