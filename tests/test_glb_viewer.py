"""What another program makes of a model: Google's model-viewer, as web pages and phones have it."""

import base64
import time

import cv2
import numpy as np
import pytest
import trimesh
from page_tools import WEB, with_packages

from texproj.formats.models import write_colored_glb
from texproj.mesh import ColoredMesh
from texproj.standing import standing

SITE = "http://model.test/"
SIZE = 240
PAGE = f"""<!doctype html><script type="module" src="viewer.js"></script>
<model-viewer id="model" loading="eager" reveal="auto" interaction-prompt="none" src="model.glb"
 shadow-intensity="0" camera-orbit="0deg 90deg auto" style="width:{SIZE}px;height:{SIZE}px">
</model-viewer>"""
RED, GREEN, BLUE = (0.8, 0.02, 0.02), (0.02, 0.6, 0.02), (0.02, 0.02, 0.8)
SETTLED_S = 8.0
"""Longest that the picture may take to come once the model is there."""


def scan():
    """A post 1 x 1 x 3 of a z-up scan, whose front looks towards -y: red above, blue below, with a
    green nose at its foot, to the right."""
    parts = [
        (RED, (-0.5, -0.5, 1.5), (0.5, 0.5, 3)), (BLUE, (-0.5, -0.5, 0), (0.5, 0.5, 1.5)),
        (GREEN, (0.5, -0.5, 0), (1, 0.5, 0.5)),
    ]  # fmt: skip
    boxes = [trimesh.creation.box(bounds=[low, high]) for _, low, high in parts]
    colors = [
        np.tile(rgb, (len(box.vertices), 1)) for (rgb, *_), box in zip(parts, boxes, strict=True)
    ]
    whole = trimesh.util.concatenate(boxes)
    return ColoredMesh(whole.vertices, whole.faces, np.concatenate(colors).astype(np.float32))


def shown(context, glb):
    """(h, w, 4) uint8 RGBA of a model as model-viewer shows it from the front."""
    script = WEB / "node_modules/@google/model-viewer/dist/model-viewer.min.js"
    files = {
        "": (PAGE.encode(), "text/html"),
        "viewer.js": (script.read_bytes(), "text/javascript"),
        "model.glb": (glb.read_bytes(), "model/gltf-binary"),
    }

    def answer(route):
        name = route.request.url.removeprefix(SITE)
        if name not in files:
            route.abort()
            return
        body, kind = files[name]
        route.fulfill(body=body, content_type=kind)

    page = context.new_page()
    page.route("**/*", answer)
    page.goto(SITE)
    page.wait_for_function("document.querySelector('#model').loaded")
    end = time.monotonic() + SETTLED_S
    while True:  # the first frames are empty
        data = page.evaluate("document.querySelector('#model').toDataURL('image/png')")
        found = np.frombuffer(base64.b64decode(data.split(",")[1]), np.uint8)
        image = cv2.imdecode(found, cv2.IMREAD_UNCHANGED)
        if (image[..., 3] > 0).any() or time.monotonic() > end:
            page.close()
            return cv2.cvtColor(image, cv2.COLOR_BGRA2RGBA)
        page.wait_for_timeout(50)


def middle_of(image, channel):
    """(2,) mean column and row, from -1 to 1, of the pixels of one of the colors."""
    rgb = image[..., :3].astype(int)
    others = np.delete(rgb, channel, axis=2).max(axis=2)
    rows, columns = np.nonzero((image[..., 3] > 128) & (rgb[..., channel] > others + 60))
    assert len(rows), "the color is not in the picture"
    return 2 * np.array([columns.mean(), rows.mean()]) / len(image) - 1


def extent(image):
    """Rows and columns that a model takes up."""
    seen = image[..., 3] > 128
    return [np.ptp(np.flatnonzero(seen.any(axis=axis))) for axis in (1, 0)]


def test_a_scan_with_z_upwards_stands_upright(browser, tmp_path):
    """With its setting red is above blue, the post is twice as high as wide, and the nose is at its
    foot on the right, as seen from the front. Were y up, it would lie on its back: one looks onto
    its top.
    """
    with_packages()
    context = browser.new_context(viewport={"width": SIZE, "height": SIZE})
    for up in "zy":
        write_colored_glb(tmp_path / f"{up}.glb", scan(), True, standing(up, "m", ()))
    image, lying = [shown(context, tmp_path / f"{up}.glb") for up in "zy"]
    context.close()
    red, green, blue = (middle_of(image, channel) for channel in range(3))
    rows, columns = extent(image)

    assert rows / columns == pytest.approx(3 / 1.5, rel=0.1)
    assert red[1] < -0.15 < 0.15 < blue[1]
    assert green[0] > blue[0] + 0.1
    assert green[1] > blue[1] + 0.1
    rows, columns = extent(lying)
    assert rows < columns
