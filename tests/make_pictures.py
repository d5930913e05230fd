"""Make README's picture from a demo project that has been run.

python tests/make_pictures.py texproj-demo IMG_0005.jpg
"""

import sys
from pathlib import Path

import cv2
import numpy as np

from texproj.formats.models import read_model
from texproj.project import Project
from texproj.render import GBuffer, render_model
from texproj.report.pictures import BACKDROP, encoded, on_backdrop
from texproj.stages.bench import Workbench

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "demo.jpg"
HEIGHT = 520
GAP = 12
AMBIENT = 0.25
"""Brightness of the bare scan where its surface is seen edge-on."""


def main() -> None:
    """A photo, the bare scan and the colored model, all from the photo's camera."""
    project = Project.open(Path(sys.argv[1]))
    name = sys.argv[2] if len(sys.argv) > 2 else project.photo_names[0]
    camera = project.load_cameras()[name].registered_camera
    with Workbench(project) as bench:
        small = camera.scaled(HEIGHT / camera.height)
        photo = project.load_photo(name, max(small.width, small.height))
        small = camera.resized(photo.width, photo.height)
        bare = shaded(bench.scene.gbuffer(small, ("normal", "ao")))
        model = read_model(project.out / "model.glb")
        colored = on_backdrop(render_model(bench.renderer, model, small, samples=3))
    gap = np.full((small.height, GAP, 3), 255, np.uint8)
    row = np.concatenate([encoded(photo), gap, bare, gap, colored], axis=1)
    PICTURE.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(PICTURE), cv2.cvtColor(row, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 88])


def shaded(images: GBuffer) -> np.ndarray:
    """(h, w, 3) uint8: bare geometry lit from the camera, darkened by ambient occlusion."""
    normal, ao = images.require("normal"), images.require("ao")
    light = (AMBIENT + (1 - AMBIENT) * np.abs(normal[..., 2])) * ao
    grey = np.round(255 * light.clip(0, 1)).astype(np.uint8)
    return np.where((normal == 0).all(axis=-1), np.uint8(BACKDROP), grey)[..., None].repeat(
        3, axis=2
    )


if __name__ == "__main__":
    main()
