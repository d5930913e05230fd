"""Color error on synthetic photos with known truth, one defect after the other.

    python tests/color_synthetic.py [--to texture,vertices,patches] [--defects none,exposure,all]

Seven photos of a painted, veined stone under a veiled sun (tests/scenes.py, `exposure_round`):
steps of exposure up to 1 EV either way, 35 % vignetting, somebody in front of one photo, one out
of focus, a highlight. Each defect alone, none, and all; true cameras. What "none" leaves is the
floor of the photos' resolution, the scan's noise and the model's own resolution; what a row has
above it is due to the defect. How it is measured: tests/color_truth.py.
"""

from __future__ import annotations

import argparse
import time

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
from scenes import Synthetic

from texproj.color.patches import PatchSettings, color_patches
from texproj.color.texture import color_texture
from texproj.color.vertices import color_vertices
from texproj.mesh import ColoredMesh, TexturedMesh
from texproj.options import ColorOptions, RenderOptions
from texproj.photo import srgb_from_linear
from texproj.render import Renderer, open_renderer
from texproj.stages.writing import textured_mesh

HEADER = (f"{'to':9} {'defects':10} {'cpu s':>5}  {'surface':>12}  {'in the photos':>13}  "
          f"{'in new photos':>13}  brightness")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--to", default="texture,vertices,patches")
    parser.add_argument("--defects", default=",".join(rounds()))
    given = parser.parse_args()
    table(given.to.split(","), given.defects.split(","))


def table(kinds: list[str], names: list[str]) -> None:
    """Print CIEDE2000, median and 95 %, of what at least one photo sees."""
    print("CIEDE2000 against true albedo x shading, median / 95 %")
    print(HEADER)
    with open_renderer(RenderOptions()) as renderer:
        for name in names:
            data, _ = made(rounds()[name])
            for kind in kinds:
                start = time.process_time()
                model = colored(kind, data, renderer)
                seconds = time.process_time() - start
                print(f"{kind:9} {name:10} {seconds:5.1f}  {line(model, renderer)}", flush=True)


def line(model: TexturedMesh | ColoredMesh, renderer: Renderer) -> str:
    """The errors of one model."""
    errors = [
        surface_errors(model, true_points()),
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
    given = data.mesh, data.cameras, lambda i: data.photos[i], renderer
    if kind == "vertices":
        rgb = srgb_from_linear(color_vertices(*given, options).rgb)
        colors = np.round(rgb * 255).astype(np.uint8)
        return ColoredMesh(data.mesh.vertices, data.mesh.faces, colors)
    if kind == "patches":
        return textured_mesh(data.mesh, color_patches(*given, PatchSettings(options)))
    return textured_mesh(data.mesh, color_texture(*given, options))


if __name__ == "__main__":
    main()
