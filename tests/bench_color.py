"""Color against photos that were left out, beside other programs; seams, time, memory, scale.

    python tests/bench_color.py --script REPHOTO.py [--what scenes,limit,scale,synthetic,niche]
                                [--data DIR] [--scenes sceaux-castle,fountain-P11] [--keep DIR]
                                [--to texture,patches,vertices] [--python-open3d PYTHON]

scenes: for each scene a project is made of the photos that are not held out, at the reference
cameras; `texproj color` and the peers run on it as processes of their own; models are compared with
the photos left out by the measuring script whose path is given (virtual rephotography, Waechter et
al. 2017; without it fidelity is not measured). Seams: mean color step across borders of charts
against the step inside, and the same divided by what the photos show there (tests/seams.py).
limit: the whole command with all photos against what nobody can avoid: decoding all photos, one
visibility render each, writing the files. scale: tests/color_scale.py. synthetic: color error
against known truth, tests/color_synthetic.py. niche: the same behind the demo's visitor,
tests/color_niche.py. PyMeshLab is run if it can (it needs Qt's platform
plugins), Open3D if this Python or the one given has it; others are looked for on PATH.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

import color_niche
import color_scale
import color_synthetic
from color_peers import missing, open3d_python, peers
from color_runs import CHECKOUT, HELD_OUT, MODEL, Run, color, compared, make_project
from color_truth import rounds
from seams import project_seams

from texproj.options import DemoOptions

MEASURES = {"psnr": "PSNR", "ssim": "SSIM", "one_minus_ncc": "1-NCC", "detail": "detail"}


def main() -> None:
    given = _arguments()
    what, kinds = given.what.split(","), given.to.split(",")
    with tempfile.TemporaryDirectory() as temporary:
        root = given.keep or Path(temporary)
        scenes = [given.data / name for name in given.scenes.split(",")]
        if "scenes" in what:
            compare(scenes, root, given)
        if "limit" in what:
            color_scale.limits(scenes, root, kinds)
        if "scale" in what:
            color_scale.scale(given.data, root, kinds)
    if "niche" in what:
        for options in (DemoOptions(), DemoOptions(photos=9, starts=True)):
            color_niche.table(options)
    if "synthetic" in what:
        color_synthetic.table(kinds, list(rounds()), [40_000, 160_000, 0])


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    default = os.environ.get("TEXPROJ_DATA") or CHECKOUT / "../shared/data"
    parser.add_argument("--what", default="scenes,limit,synthetic")
    parser.add_argument("--data", type=Path, default=Path(default))
    parser.add_argument("--scenes", default=",".join(HELD_OUT))
    parser.add_argument("--to", default="texture,patches,vertices")
    parser.add_argument("--script", type=Path, help="the measuring script")
    parser.add_argument("--python-open3d", help="an interpreter that has Open3D")
    parser.add_argument("--keep", type=Path, help="folder in which the projects stay")
    return parser.parse_args()


def compare(scenes: list[Path], root: Path, given: argparse.Namespace) -> None:
    """Print the table of fidelity, one row per program."""
    print(missing())
    measures = "".join(f"{name:>7}" for name in MEASURES.values())
    print(
        f"{'scene':14} {'program':18} {'s':>7} {'cpu s':>7} {'MB':>6}{'seen':>7}{measures}  seams"
    )
    open3d = open3d_python(given.python_open3d)
    for data in scenes:
        project = root / data.name
        make_project(data, project)
        for kind in sorted(given.to.split(","), key=lambda kind: kind == "texture"):
            run, model = color(project, kind), project / "out" / MODEL[kind]
            row(data, f"texproj {kind}", run, model, given.script)
            print(_seams(project, kind), flush=True)
        for peer in peers(project, root / f"{data.name}-peers", open3d):
            row(data, peer.name, peer.run, peer.model, given.script)
            print(f"  {peer.run.failure}", flush=True)


def row(data: Path, name: str, run: Run, model: Path | None, script: Path | None) -> None:
    """Print a line up to its seams."""
    line = f"{data.name:14} {name:18} {run}"
    if script is not None and model is not None:
        found = compared(data, model, script)
        line += "".join(f"{found[name]:7.3f}" for name in ("seen", *MEASURES))
    print(line, end="")


def _seams(project: Path, kind: str) -> str:
    if kind == "vertices":
        return ""
    seams = project_seams(project)
    return f"  {seams.ratio:.2f} ({seams.excess:.2f})"


if __name__ == "__main__":
    main()
