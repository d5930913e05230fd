"""One table of what matters, to run on any machine: how exact, how good, how fast, how large.

    python tests/bench_all.py [--data DIR] [--scenes sceaux-castle,fountain-P11] [--script REPHOTO]
        [--keep DIR] [--write]

A scene folder holds mesh.ply, photos/ and cameras_reference.json. Of loose photos and the mesh a
project is made, and each step of `texproj run` is run on it as a command of its own. Columns:
seconds on the clock, processor seconds, peak megabytes of the largest process, and what came out:

register, refine: photos registered; mean distance of the surface in the full-size photo, pixels,
median / largest over the photos, after refinement also with one common similarity taken out
("apart").
color: processor seconds over what nobody can avoid, measured in the same run (decoding all photos,
one visibility render each, writing the files).
report; run again: the whole command where nothing is stale.
held out: PSNR, dB, of photos that were not used for color, at the reference cameras, by the
measuring script (virtual rephotography, Waechter et al. 2017); only where it is given.

Behind each figure, what docs/benchmarks.md has kept; --write keeps the new ones there;
`python tests/make_reference.py` then puts the most telling ones into README.md.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from block_errors import best_similarity, offsets_px, visible
from color_runs import CHECKOUT, MODEL, Run, color, compared, make_project, timed
from color_scale import against_limit
from kept_figures import HEAD, KEPT, Cells, kept, with_rows

from texproj.formats.cameras import read_cameras
from texproj.formats.meshes import read_mesh


@dataclass(frozen=True)
class Row:
    """A step of a scene."""

    scene: str
    step: str
    run: Run
    result: str

    @property
    def cells(self) -> tuple[str, ...]:
        run = self.run
        took = f"{run.seconds:.1f}", f"{run.cpu:.1f}", f"{run.megabytes:.0f}"
        return (self.scene, self.step, *took, self.result)


def main() -> None:
    given = _arguments()
    before, rows = kept(KEPT.read_text()), []
    print(" | ".join(HEAD))
    with tempfile.TemporaryDirectory() as temporary:
        for name in given.scenes.split(","):
            for row in scene_rows(given.data / name, (given.keep or Path(temporary)), given.script):
                rows.append(row.cells)
                print(_beside(row.cells, before), flush=True)
    if given.write:
        KEPT.write_text(with_rows(KEPT.read_text(), rows))


def scene_rows(data: Path, root: Path, script: Path | None) -> Iterator[Row]:
    """Every step on one scene."""
    project = root / f"{data.name}-loose"
    made = texproj("new", project, "--mesh", data / "mesh.ply", "--photos", data / "photos")
    yield Row(data.name, "new", made, "")
    yield Row(data.name, "register", texproj("register", project), exactness(data, project)[0])
    yield Row(data.name, "refine", texproj("refine", project), ", ".join(exactness(data, project)))
    colored = texproj("color", project)
    yield Row(data.name, "color", colored, against_limit(project, colored).split("; ")[1])
    yield Row(data.name, "report", texproj("report", project), "")
    yield Row(data.name, "run again", texproj("run", project), "")
    if script is not None:
        apart = root / f"{data.name}-held-out"
        make_project(data, apart)
        run = color(apart, "texture")
        found = compared(data, apart / "out" / MODEL["texture"], script)
        yield Row(data.name, "held out", run, f"{found['psnr']:.2f} dB")


def texproj(*command: str | Path) -> Run:
    """A whole command. Raises SystemExit if it fails."""
    run = timed([sys.executable, "-m", "texproj", *command])
    if run.failure:
        raise SystemExit(f"texproj {' '.join(map(str, command))}: {run.failure}")
    return run


def exactness(data: Path, project: Path) -> tuple[str, str]:
    """Photos and pixels, as they are and with one common similarity taken out."""
    true = {r.file: r.camera for r in read_cameras(data / "cameras_reference.json").records}
    records = read_cameras(project / "cameras.json").records
    found = {r.file: r.registered_camera for r in records if r.registered_camera is not None}
    vertices = read_mesh(data / "mesh.ply")[0]
    wanted = [true[name] for name in found]
    seen = [visible(camera, vertices) for camera in wanted]
    common = best_similarity(list(found.values()), wanted, seen)

    def off(cameras: Sequence) -> str:
        sets = zip(cameras, wanted, seen, strict=True)
        px = [float(np.mean(offsets_px(a, b, xyz))) for a, b, xyz in sets]
        return f"{np.median(px):.2f} / {max(px):.2f} px"

    apart = off([common.camera(camera) for camera in found.values()])
    as_is = off(list(found.values()))
    return f"{len(found)} of {len(true)}, {as_is}", f"apart {apart}"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    default = os.environ.get("TEXPROJ_DATA") or CHECKOUT / "../shared/data"
    parser.add_argument("--data", type=Path, default=Path(default))
    parser.add_argument("--scenes", default="sceaux-castle,fountain-P11")
    parser.add_argument("--script", type=Path, help="measures a model against photos left out")
    parser.add_argument("--keep", type=Path, help="leave the projects here")
    parser.add_argument("--write", action="store_true", help=f"keep the table in {KEPT.name}")
    return parser.parse_args()


def _beside(cells: Cells, kept_rows: dict[tuple[str, str], Cells]) -> str:
    before = kept_rows.get((cells[0], cells[1]), cells)
    told = [
        now if now == old else f"{now} (was {old})"
        for now, old in zip(cells, before, strict=True)
    ]  # fmt: skip
    return " | ".join(told)


if __name__ == "__main__":
    main()
