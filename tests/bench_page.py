"""The page by mouse alone on real photographs, and how fast it is (not collected).

    python tests/bench_page.py clicks     fountain without cameras: 8 sloppy picks in one photo
    python tests/bench_page.py speed      first picture, frames while turning, 250 k and 1 M faces
    python tests/bench_page.py list       500 photos in the list

clicks: from opening the page to the colored model by real clicks at whole screen pixels; each pick
in the photo is 5 to 25 px off in a direction drawn at random. Floors: 20 clicks, 11 of 11 photos,
median true error 1.4 px. speed: 2 s and 3 s to the first picture, 15 and 8 frames a second, on two
cores with software WebGL. list: 100 ms to filter or to draw anew.

Needs TEXPROJ_DATA (or ../shared/data), Playwright and Chromium (TEXPROJ_BROWSER).
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
from browsing import CHECKOUT, chromium, model_place, photo_place, settle, until
from preview_project import make_project, running

from texproj.creation import create_project
from texproj.formats.cameras import read_cameras
from texproj.project import Project

DATA = Path(os.environ.get("TEXPROJ_DATA") or CHECKOUT / "../shared/data") / "fountain-P11"
SIZE = {"width": 1400, "height": 900}
PICKS, LEAST_PX, MOST_PX, SEED = 8, 5.0, 25.0, 2
LONG_S = 1800

NEAR = """async p => {
  const at = texproj.viewport.toScreen(p);
  const [w, h] = texproj.viewport.size;
  if (!at || at[0] < 8 || at[1] < 8 || at[0] > w - 8 || at[1] > h - 8) return [null];
  const around = [[0, 0], [2, 2], [-2, 2], [2, -2], [-2, -2]];
  return Promise.all(around.map(([x, y]) => texproj.hit([at[0] + x, at[1] + y])));
}"""


def fountain(folder: Path, mesh: str) -> Path:
    """A project of the fountain's photos and a mesh, without cameras."""
    root = folder / "fountain"
    create_project(root, DATA / mesh, [DATA / "photos"], link=True)
    return root


class Mouse:
    """Clicks at whole pixels, counted."""

    def __init__(self, page) -> None:
        self.page, self.clicks = page, 0

    def at(self, x: float, y: float) -> None:
        self.page.mouse.click(round(x), round(y))
        self.clicks += 1

    def on(self, selector: str) -> None:
        box = self.page.locator(selector).bounding_box()
        self.at(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)


def targets(page, camera, surface) -> list[tuple[np.ndarray, np.ndarray]]:
    """Pixels and points of the surface that photo and view of the model show, spread widely."""
    grid = np.stack(np.meshgrid(np.linspace(0.1, 0.9, 15), np.linspace(0.1, 0.9, 11)), -1).reshape(
        -1, 2
    ) * (camera.width, camera.height)
    good = []
    for origin, direction, pixel in zip(*camera.rays(grid), grid, strict=True):
        hit = surface.hit(origin, direction)
        if hit is None or hit.back:
            continue
        seen = page.evaluate(NEAR, hit.xyz.tolist())
        apart = [np.linalg.norm(np.array(s["xyz"]) - hit.xyz) if s else np.inf for s in seen]
        if max(apart) < 0.02 * np.linalg.norm(np.ptp(surface.mesh.vertices, axis=0)):
            good.append((pixel, hit.xyz))
    pixels = np.array([pixel for pixel, _ in good])
    chosen = [int(np.argmin(pixels.sum(1)))]
    while len(chosen) < PICKS:
        gap = np.linalg.norm(pixels[:, None] - pixels[chosen][None], axis=2).min(1)
        chosen.append(int(gap.argmax()))
    return [good[k] for k in chosen]


def clicks(folder: Path) -> None:
    """The whole job by mouse."""
    from texproj.preview.surface import Surface

    root = fountain(folder, "mesh.ply")
    truth = {r.file: r.camera for r in read_cameras(DATA / "cameras_reference.json").records}
    surface = Surface(Project.open(root), 30_000)
    rng = np.random.default_rng(SEED)
    with chromium() as browser, running(root) as home:
        page = browser.new_page(viewport=SIZE)
        page.goto(home)
        page.wait_for_selector("body[data-ready=true]", timeout=60_000)
        settle(page)
        mouse, begun = Mouse(page), time.monotonic()
        mouse.on("#start-pick")
        until(page, "document.body.dataset.mode === 'pick'")
        photo = page.evaluate("texproj.picking.photo.name")
        page.wait_for_selector(f'#photo-pane[data-sharp="{photo}"]', timeout=60_000)
        settle(page)
        for pixel, xyz in targets(page, truth[photo], surface):
            angle, off = rng.uniform(0, 2 * np.pi), rng.uniform(LEAST_PX, MOST_PX)
            sloppy = pixel + off * np.array([np.cos(angle), np.sin(angle)])
            mouse.at(*photo_place(page, sloppy))
            mouse.at(*model_place(page, xyz))
            until(page, "!texproj.picking.selectedPick || texproj.picking.selectedPick.xyz")
        until(page, "!texproj.picking.fitting && texproj.picking.saved === 'saved'")
        print("before Solve:", page.locator("#verdict").inner_text())
        mouse.on("#solve")
        until(page, "texproj.picking.solved", LONG_S)
        page.wait_for_timeout(1000)
        print("after Solve:", page.locator("#verdict").inner_text())
        page.screenshot(path=folder / "solved.png")
        mouse.on("#find-others")
        until(page, "texproj.facts.photos.every(p => p.status !== 'none')", LONG_S)
        until(page, "!document.querySelector('#do-run').disabled", LONG_S)
        mouse.on("#do-run")
        until(page, "texproj.facts.models['model.glb']", LONG_S)
        until(page, "!document.querySelector('#do-run').disabled", LONG_S)
        settle(page)
        page.screenshot(path=folder / "made.png")
        told(root, truth, surface, mouse.clicks, time.monotonic() - begun)


def told(root: Path, truth, surface, count: int, seconds: float) -> None:
    """Photos and true errors: mean distance of what a photo shows of the surface, pixels."""
    vertices = surface.mesh.vertices[::50]
    errors = []
    for name, record in Project.open(root).load_cameras().items():
        if record.registered_camera is not None:
            ours, theirs = record.camera.project(vertices)[0], truth[name].project(vertices)[0]
            inside = truth[name].inside(theirs) & np.isfinite(ours).all(1)
            errors.append(float(np.linalg.norm(ours - theirs, axis=1)[inside].mean()))
    print(f"{count} clicks, {len(errors)} of {len(truth)} photos, {seconds:.0f} s")
    print(f"true error: median {np.median(errors):.2f} px, largest {max(errors):.2f} px")


def speed(folder: Path) -> None:
    """First picture and frames a second, best of two pages."""
    for mesh in ("mesh.ply", "mesh_1m.ply"):
        root = fountain(folder / mesh, mesh)
        with chromium() as browser, running(root, light_faces=30_000) as home:
            time.sleep(15)  # the server has loaded the mesh, as it does while one opens the browser
            first, frames = [], []
            for _ in range(2):
                page = browser.new_page(viewport=SIZE)
                begun = time.monotonic()
                page.goto(home)
                page.wait_for_selector("body[data-picture=true]", timeout=120_000)
                first.append(time.monotonic() - begun)
                settle(page)
                frames.append(turned(page))
                page.close()
        print(f"{mesh}: first picture {min(first):.1f} s, {max(frames):.0f} frames/s turning")


TURN_S = 4.0


def turned(page) -> float:
    """Frames a second while the model is dragged, after a moment in which it gets used to it."""
    box = page.locator("#model-canvas").bounding_box()
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.evaluate("texproj.startCard = false; document.querySelector('#start').hidden = true")
    page.mouse.move(*middle)
    page.mouse.down()
    counted, begun, k = None, time.monotonic(), 0
    while time.monotonic() - begun < TURN_S + 1:
        k += 1
        page.mouse.move(middle[0] + 150 * np.sin(k / 8), middle[1] + 30 * np.cos(k / 8))
        if counted is None and time.monotonic() - begun > 1:
            counted = (page.evaluate("texproj.viewport.frames"), time.monotonic())
    frames, at = counted
    found = (page.evaluate("texproj.viewport.frames") - frames) / (time.monotonic() - at)
    page.mouse.up()
    return found


def photo_list(folder: Path) -> None:
    """500 photos: milliseconds to filter, to draw anew where nothing changed, to load all."""
    root = folder / "many"
    make_project(root, registered=4)
    picture = cv2.imread(str(root / "photos/0000.png"))
    for k in range(4, 500):
        cv2.imwrite(str(root / f"photos/{k:04d}.png"), cv2.resize(picture, (160, 120)))
    with chromium() as browser, running(root) as home:
        page = browser.new_page(viewport=SIZE)
        page.goto(home)
        page.wait_for_selector("body[data-ready=true]", timeout=60_000)
        settle(page)
        timed = (
            "act => { const t = performance.now(); new Function(act)();"
            " document.querySelector('#photo-list').offsetHeight; return performance.now() - t }"
        )
        fill = "const s = document.querySelector('#photo-search'); s.value = '{}';"
        fill += "s.dispatchEvent(new Event('input'))"
        acts = {
            "draw anew": "texproj.show()",
            "search": fill.format("12"),
            "all again": fill.format(""),
        }
        for name, act in acts.items():
            print(f"{name}: {page.evaluate(timed, act):.0f} ms")
        begun = time.monotonic()
        page.evaluate("texproj.refresh()")
        print(f"load all facts anew: {1000 * (time.monotonic() - begun):.0f} ms")


if __name__ == "__main__":
    parts = {"clicks": clicks, "speed": speed, "list": photo_list}
    scratch = Path(tempfile.mkdtemp(prefix="bench-page-"))
    try:
        for part in sys.argv[1:] or parts:
            parts[part](scratch)
    finally:
        if os.environ.get("TEXPROJ_KEEP") is None:
            shutil.rmtree(scratch)
        else:
            print("kept", scratch)
