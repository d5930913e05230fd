"""The page in a real browser: fixtures, and what a test does in it by mouse and keyboard."""

import base64
import os
import shutil
import time
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
from page_tools import WEB, builder
from preview_project import HEIGHT, WIDTH, cameras, corner_points

from texproj.options import RenderOptions
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.render import open_renderer

CHECKOUT = Path(__file__).resolve().parent.parent
BROWSER = os.environ.get("TEXPROJ_BROWSER") or shutil.which("chromium") or ""
FLAGS = [
    *("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
LENS_PHOTO = "0004.png"
TO_SOLVE = "0003.png"


@contextmanager
def chromium():
    """Chromium with software WebGL, on the page as its sources are now."""
    if not BROWSER:
        pytest.skip("no Chromium (apt-get install chromium, or set TEXPROJ_BROWSER)")
    build = builder()
    if build.is_stale(CHECKOUT):
        if not build.node_on_path():
            pytest.skip("the page is not built and there is no Node (python hatch_build.py)")
        build.build_page(CHECKOUT)
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as play:
        found = play.chromium.launch(executable_path=BROWSER, args=FLAGS)
        yield found
        found.close()


def add_lens_photo(root):
    """One more photo: the server's own rendering of normals through the lens."""
    camera = cameras()[1]
    cv2.imwrite(str(root / "photos" / LENS_PHOTO), rendered_normals(root, camera)[..., ::-1])
    record = CameraRecord(
        LENS_PHOTO, WIDTH, HEIGHT, camera.intrinsics, camera.pose, "registered", "import"
    )
    Project.open(root).save_cameras([record])


def rendered_normals(root, camera):
    """(h, w, 3) uint8 world normals as colors, as the page's layer of that name shows them;
    rendered at three times the size and averaged, as the page smooths its edges too."""
    mesh = Project.open(root).load_mesh().mesh
    with open_renderer(RenderOptions()) as renderer, renderer.load(mesh) as scene:
        found = scene.gbuffer(camera.scaled(3), ("depth", "normal"))
    world = found.normal_in_cam @ camera.pose.R
    rgb = np.where(np.isfinite(found.depth)[..., None], world * 0.5 + 0.5, 0x2B / 255)
    return cv2.resize(
        np.round(rgb * 255).astype(np.uint8), (WIDTH, HEIGHT), None, 0, 0, cv2.INTER_AREA
    )


WINDOW = (1100, 560)
"""Pixels, just wide enough for all three columns: software WebGL takes its time for each."""


@contextmanager
def opened(browser, home, width=WINDOW[0], height=WINDOW[1], motion="reduce"):
    """A page that is loaded; fails on any console error when it closes."""
    context = browser.new_context(
        viewport={"width": width, "height": height}, reduced_motion=motion
    )
    page = context.new_page()
    problems = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
    page.goto(home)
    page.wait_for_selector("body[data-ready=true]", timeout=30_000)
    yield page
    context.close()
    # what the server refuses is in the console, and is told in words
    expected = ("ERR_CONNECTION", "Failed to fetch", "409 (", "400 (", "ERR_INCOMPLETE_CHUNKED")
    assert [p for p in problems if not any(word in p for word in expected)] == []


def picture(page):
    """(h, w, 3) uint8 RGB of the model's canvas."""
    data = page.evaluate("texproj.viewport.picture()").split(",")[1]
    pixels = np.frombuffer(base64.b64decode(data), np.uint8)
    return cv2.imdecode(pixels, cv2.IMREAD_COLOR)[..., ::-1]


def settle(page):
    """Until nothing flies or swings any more."""
    state = "[texproj.viewport.frames, texproj.viewport.flying, texproj.viewport.moving]"
    before = None
    for _ in range(300):
        now = page.evaluate(state)
        if now == [before, False, False]:
            return
        before = now[0]
        page.wait_for_timeout(100)
    pytest.fail("the view does not come to rest")


def until(page, expression, seconds=60):
    """Wait until an expression is true (the page's policy forbids Playwright's own way)."""
    end = time.monotonic() + seconds
    while not page.evaluate(f"Boolean({expression})"):
        assert time.monotonic() < end, f"waited in vain for {expression}"
        page.wait_for_timeout(50)


AS_AT_FIRST = """() => {
  texproj.chosen = null;
  texproj.exitPhoto();
  texproj.change({ layer: 'shaded', opacity: 1, wipe: 1 });
}"""


def as_at_first(page):
    """Out of the photo that is shown, and back at the bare shape."""
    page.evaluate(AS_AT_FIRST)
    until(page, "texproj.look.layer === 'shaded' && texproj.mode === 'view'")


def row(page, name):
    return page.locator(f'.photo[data-photo="{name}"]')


def enter(page, name):
    row(page, name).click()
    page.wait_for_selector(f'body[data-overlay="{name} 8192"]', timeout=30_000)
    settle(page)


def pick_page(page, name=TO_SOLVE):
    row(page, name).click()
    row(page, name).locator("button.pick").click()
    page.wait_for_selector(f'#photo-pane[data-sharp="{name}"]', timeout=30_000)
    settle(page)


def place_on(page, pane, expression, value):
    """Client coordinates of a pixel or point in a pane."""
    at = page.evaluate(expression, value)
    box = page.locator(pane).bounding_box()
    return box["x"] + at[0], box["y"] + at[1]


def photo_place(page, uv):
    return place_on(page, "#photo-canvas", "uv => texproj.picking.pane.toScreen(uv)", list(uv))


def model_place(page, xyz):
    return place_on(page, "#model-canvas", "p => texproj.viewport.toScreen(p)", list(xyz))


NEAR = """async p => {
  const at = texproj.viewport.toScreen(p);
  const [w, h] = texproj.viewport.size;
  if (!at || at[0] < 20 || at[1] < 20 || at[0] > w - 20 || at[1] > h - 20) return [null];
  const around = [[0, 0], [3, 3], [-3, 3], [3, -3], [-3, -3]];
  return Promise.all(around.map(([x, y]) => texproj.hit([at[0] + x, at[1] + y])));
}"""


def visible_pairs(page, count):
    """True pairs whose points are seen in the model's present view, away from its outlines."""
    uv, xyz = corner_points(cameras()[3], 20)
    found = []
    for pixel, point in zip(uv, xyz, strict=True):
        hits = page.evaluate(NEAR, point.tolist())
        apart = [np.linalg.norm(np.array(h["xyz"]) - point) if h else np.inf for h in hits]
        if apart[0] < 1e-3 and max(apart) < 0.3:
            found.append((pixel, point))
    assert len(found) >= count
    return found[:count]


def click_pairs(page, pairs):
    for uv, xyz in pairs:
        page.mouse.click(*photo_place(page, uv))
        page.mouse.click(*model_place(page, xyz))
        until(page, "!texproj.picking.selectedPick || texproj.picking.selectedPick.xyz")


def saved(page):
    page.wait_for_selector('#saved[data-state="saved"]', timeout=10_000)


def residuals(page):
    until(page, "!texproj.picking.fitting && texproj.picking.fit")
    return page.evaluate("texproj.picking.fit.residual_px")


def violations(page, view):
    """What axe-core finds in the page as it is, one line each."""
    if page.evaluate("typeof axe") == "undefined":
        page.evaluate((WEB / "node_modules/axe-core/axe.min.js").read_text())
    found = page.evaluate("axe.run().then(result => result.violations)")
    return [f"{view}: {v['id']}: {n['html'][:120]}" for v in found for n in v["nodes"]]
