"""Make the pictures of the web page for README: `python tests/make_screenshots.py DEMO OUT`.

DEMO: a finished project, as `texproj demo DEMO` makes it (for "picking" projects/stele after
`texproj run`, which has picks); it is copied, not changed.
OUT: folder for the pictures. Needs Playwright and Chromium (TEXPROJ_BROWSER, default `chromium`).
"""

import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import cv2
from playwright.sync_api import Page, sync_playwright

sys.path.insert(0, str(Path(__file__).resolve().parent))

from preview_project import running

FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
DESKTOP, PHONE = (1440, 900), (390, 780)
JPEG_QUALITY = 88


def result(page: Page) -> None:
    """The colored model with its cameras."""


def through(page: Page) -> None:
    """A photo over the model, half wiped away."""
    page.keyboard.press("3")
    chosen = page.evaluate("texproj.viewable.at(-1).name")
    page.locator(f'.photo[data-photo="{chosen}"]').click()
    page.wait_for_selector(f'body[data-overlay="{chosen} 8192"]', timeout=60_000)
    page.evaluate("texproj.change({ wipe: 0.5 }); texproj.show()")


def plain(page: Page) -> None:
    """Bare shape under the light."""
    page.keyboard.press("3")


def coverage(page: Page) -> None:
    """How many photos see the surface."""
    page.locator('[data-layer="coverage"]').click()
    page.wait_for_timeout(8000)


def picking(page: Page) -> None:
    """Pairs between photo and model, one of them wrong."""
    chosen = page.evaluate(
        "(texproj.facts.photos.find(p => p.picks > 4) ?? texproj.viewable[0]).name"
    )
    page.locator(f'.photo[data-photo="{chosen}"]').click()
    page.locator(f'.photo[data-photo="{chosen}"] button.pick').click()
    page.wait_for_selector(f'#photo-pane[data-sharp="{chosen}"]', timeout=60_000)
    page.wait_for_timeout(3000)
    box = page.locator("#photo-canvas").bounding_box()
    page.mouse.move(box["x"] + box["width"] * 0.45, box["y"] + box["height"] * 0.5)


def phone(page: Page) -> None:
    """The list of photos on a phone."""
    page.get_by_role("button", name="Photos", exact=True).click()


SHOTS: dict[str, tuple[Callable[[Page], None], tuple[int, int]]] = {
    "result": (result, DESKTOP),
    "through": (through, DESKTOP),
    "plain": (plain, DESKTOP),
    "coverage": (coverage, DESKTOP),
    "picking": (picking, DESKTOP),
    "phone": (phone, PHONE),
}


def main(demo: Path, out: Path) -> None:
    """Copy the project, serve it, and write one JPEG per shot."""
    out.mkdir(parents=True, exist_ok=True)
    browser = os.environ.get("TEXPROJ_BROWSER") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        root = shutil.copytree(demo, Path(folder) / demo.resolve().name)
        chromium = play.chromium.launch(executable_path=browser, args=FLAGS)
        with running(Path(root)) as home:
            for name, (act, (width, height)) in SHOTS.items():
                page = chromium.new_page(viewport={"width": width, "height": height})
                page.goto(home)
                page.wait_for_selector("body[data-ready=true]", timeout=60_000)
                page.wait_for_timeout(2000)
                act(page)
                page.wait_for_timeout(4000)
                page.screenshot(path=str(Path(folder) / "shot.png"))
                page.close()
                picture = cv2.imread(str(Path(folder) / "shot.png"))
                quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
                cv2.imwrite(str(out / f"preview-{name}.jpg"), picture, quality)
                print(out / f"preview-{name}.jpg")
        chromium.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
