"""Color against photos that were left out: fidelity, time, memory.

    python tests/bench_color.py [--data DIR] [--scenes sceaux-castle,fountain-P11] [--to texture]
                                [--script rephoto.py] [--keep DIR]

For each scene a project is made of the photos that are not held out, at the reference cameras,
`texproj color` is run on it as a process of its own, and the model is compared with the photos
left out by the measuring script whose path is given (virtual rephotography, Waechter et al. 2017);
without a script only time, memory and coverage are printed. Further texturing programs are named
if they are on PATH; they are not run.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
HELD_OUT = {"sceaux-castle": ("00003", "00006"), "fountain-P11": ("0003", "0007")}
PEERS = ("texrecon", "TextureMesh", "meshroom_batch", "colmap")
MEASURES = ("psnr", "ssim", "one_minus_ncc", "detail")
MODEL = {"vertices": "model.ply", "texture": "model.obj", "patches": "model.obj"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    default = os.environ.get("TEXPROJ_DATA") or CHECKOUT / "../shared/data"
    parser.add_argument("--data", type=Path, default=Path(default))
    parser.add_argument("--scenes", default=",".join(HELD_OUT))
    parser.add_argument("--to", default="texture,vertices")
    parser.add_argument("--script", type=Path, help="the measuring script")
    parser.add_argument("--keep", type=Path, help="folder in which the projects stay")
    given = parser.parse_args()
    print("programs beside:", ", ".join(f"{p} {'found' if shutil.which(p) else 'not found'}"
                                        for p in PEERS))  # fmt: skip
    print(f"{'scene':14} {'to':9} {'s':>6} {'cpu s':>6} {'MB':>5} {'seen':>6}  ", *MEASURES)
    with tempfile.TemporaryDirectory() as temporary:
        root = given.keep or Path(temporary)
        for scene in given.scenes.split(","):
            for kind in given.to.split(","):
                row(given.data / scene, root / f"{scene}-{kind}", kind, given.script)


def row(data: Path, project: Path, kind: str, script: Path | None) -> None:
    """Run one scene and print its line of the table."""
    make_project(data, project)
    seconds, cpu, megabytes = timed_color(project, kind)
    record = next((project / "work").rglob("color*.json"))
    seen = json.loads(record.read_text())["quality"]["seen"]
    line = f"{data.name:14} {kind:9} {seconds:6.1f} {cpu:6.1f} {megabytes:5.0f} {seen:6.3f}  "
    if script is not None:
        found = rephotographed(data, project / "out" / MODEL[kind], script)
        line += " ".join(f"{found[name]:.3f}" for name in MEASURES)
    print(line, flush=True)


def make_project(data: Path, project: Path) -> None:
    """A project of the photos that are not held out, at the reference cameras."""
    if project.exists():
        shutil.rmtree(project)
    (project / "mesh").mkdir(parents=True)
    (project / "photos").mkdir()
    shutil.copy(data / "mesh.ply", project / "mesh")
    (project / "project.toml").touch()
    cameras = json.loads((data / "cameras_reference.json").read_text())
    held = HELD_OUT[data.name]
    cameras["photos"] = [p for p in cameras["photos"] if Path(p["file"]).stem not in held]
    (project / "cameras.json").write_text(json.dumps(cameras))
    for photo in cameras["photos"]:
        (project / "photos" / photo["file"]).symlink_to((data / "photos" / photo["file"]).resolve())


def timed_color(project: Path, kind: str) -> tuple[float, float, float]:
    """Seconds, processor seconds and peak megabytes of the whole command."""
    command = [sys.executable, "-m", "texproj", "color", str(project), "--to", kind]
    start = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=CHECKOUT)
    _, status, used = os.wait4(process.pid, 0)
    seconds = time.monotonic() - start
    if status:
        raise SystemExit(f"{' '.join(command)} failed")
    return seconds, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def rephotographed(data: Path, model: Path, script: Path) -> dict[str, float]:
    """The script's means over the held-out photos, all seen pixels, affine."""
    out = model.with_suffix(".rephoto.json")
    command = [sys.executable, script, model, data / "cameras_reference.json", "--photos",
               data / "photos", "--held-out", ",".join(HELD_OUT[data.name]),
               "--reference-mesh", data / "mesh.ply", "--out", out]  # fmt: skip
    if (data / "eval_masks").is_dir():
        command += ["--masks", data / "eval_masks"]
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
    return json.loads(out.read_text())["mean"]["within_seen"]["affine"]


if __name__ == "__main__":
    main()
