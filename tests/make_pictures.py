"""Make README's picture from a demo project that has been run.

python tests/make_pictures.py texproj-demo
"""

import sys
from pathlib import Path

import cv2
import numpy as np

from texproj.formats.models import read_model
from texproj.project import Project
from texproj.render import render_model, shade
from texproj.report.pictures import encoded, on_paper
from texproj.stages.bench import Workbench

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "demo.jpg"
HEIGHT = 520
GAP = 12


def main() -> None:
    """A photo, the bare scan and the colored model, all from the photo's camera."""
    project = Project.open(Path(sys.argv[1]))
    name = sys.argv[2] if len(sys.argv) > 2 else project.photo_names[0]
    camera = project.load_cameras()[name].registered_camera
    with Workbench(project) as bench:
        small = camera.scaled(HEIGHT / camera.height)
        photo = project.load_photo(name, max(small.width, small.height))
        small = camera.resized(photo.width, photo.height)
        bare = shade(bench.scene.gbuffer(small, ("normal", "ao")), (238, 238, 238))
        model = read_model(project.out / "model.glb")
        colored = on_paper(render_model(bench.renderer, model, small, samples=3))
    gap = np.full((small.height, GAP, 3), 255, np.uint8)
    row = np.concatenate([encoded(photo), gap, bare, gap, colored], axis=1)
    PICTURE.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(PICTURE), cv2.cvtColor(row, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
