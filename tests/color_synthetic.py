"""Color error on synthetic photos with known truth, one defect after the other.

    python tests/color_synthetic.py [--to texture,vertices,patches] [--defects none,exposure,all]
                                    [--scans 40000,160000,0]

Seven photos of a painted, veined stone under a veiled sun (tests/scenes.py, `exposure_round`):
steps of exposure up to 1 EV either way, 35 % vignetting, somebody in front of one photo, one out
of focus, a highlight. Each defect alone, none, and all; true cameras. What "none" leaves is the
floor of the photos' resolution, the scan's noise and the model's own resolution; what a row has
above it is due to the defect. Scans: number of faces; 0 is the true surface in the place of a scan,
so that the rest is the photos' resolution and noise. How it is measured: tests/color_truth.py.
"""

from __future__ import annotations

import argparse
import time
from itertools import product

import numpy as np
from color_truth import (
    Errors,
    made,
    picture_errors,
    rounds,
    surface_errors,
    true_points,
    true_views,
)
from photo_sets import photo_set
from scenes import Synthetic

from texproj.color.patches.texture import PatchSettings, color_patches
from texproj.color.result import textured_mesh
from texproj.color.texture import color_texture
from texproj.color.vertices import color_vertices
from texproj.mesh import ColoredMesh, TexturedMesh
from texproj.options import ColorOptions, RenderOptions
from texproj.photo import srgb_from_linear
from texproj.render import Renderer, open_renderer

COLUMNS = f"{'surface':>13}  {'in the photos':>13}  {'in new photos':>13}  brightness"
HEADER = f"{'scan':>6} {'to':9} {'defects':10} {'cpu s':>5}  {COLUMNS}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--to", default="texture,vertices,patches")
    parser.add_argument("--defects", default=",".join(rounds()))
    parser.add_argument("--scans", default="40000,160000,0")
    given = parser.parse_args()
    scans = [int(faces) for faces in given.scans.split(",")]
    table(given.to.split(","), given.defects.split(","), scans)


def table(kinds: list[str], names: list[str], scans: list[int]) -> None:
    """Print CIEDE2000, median and 95 %, of what at least one photo sees."""
    print("CIEDE2000 against true albedo x shading, median / 95 % (floor asked: 1.5 / 4)")
    print(HEADER)
    with open_renderer(RenderOptions()) as renderer:
        for faces, name, kind in product(scans, names, kinds):
            data, _ = made(rounds()[name], faces)
            start = time.process_time()
            model = colored(kind, data, renderer)
            seconds = time.process_time() - start
            what = f"{faces or 'true':>6} {kind:9} {name:10} {seconds:5.1f}"
            print(f"{what}  {line(model, faces, renderer)}", flush=True)


def line(model: TexturedMesh | ColoredMesh, faces: int, renderer: Renderer) -> str:
    """The errors of one model."""
    errors = [
        surface_errors(model, true_points(faces)),
        picture_errors(model, true_views(False), renderer),
        picture_errors(model, true_views(True), renderer),
    ]
    return "  ".join(f"{short(e):>13}" for e in errors) + f"  {1 / errors[2].gain:.3f}"


def short(errors: Errors) -> str:
    return f"{errors.median:.2f} / {errors.p95:.2f}"


def colored(
    kind: str, data: Synthetic, renderer: Renderer, options: ColorOptions | None = None
) -> TexturedMesh | ColoredMesh:
    """The scan colored from the photos at their true cameras."""
    options = options or ColorOptions()
    given = data.mesh, photo_set(data.cameras, data.photos), renderer
    if kind == "vertices":
        rgb = srgb_from_linear(color_vertices(*given, options).rgb)
        colors = np.round(rgb * 255).astype(np.uint8)
        return ColoredMesh(data.mesh.vertices, data.mesh.faces, colors)
    if kind == "patches":
        return textured_mesh(data.mesh, color_patches(*given, PatchSettings(options)))
    return textured_mesh(data.mesh, color_texture(*given, options))


if __name__ == "__main__":
    main()
