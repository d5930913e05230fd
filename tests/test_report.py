"""The report: a verdict that follows from the numbers, and the model inside of the page."""

import base64
import json
import zlib

import numpy as np
import pytest
from color_scenes import plane
from test_color_occluders import colored, photos, project_of

from texproj.mesh import ColoredMesh, TexturedMesh
from texproj.project import Project
from texproj.report import model as report_model
from texproj.report.model import packed_model
from texproj.report.verdict import verdict
from texproj.report.words import details, light_of, shared_notes
from texproj.stages import depicting
from texproj.stages.bench import Workbench
from texproj.stages.reporting import report_project

UP, FRONT = np.array([0.0, 0, 1]), np.array([0.0, -1, 0])


def numbers(text, kind):
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), kind)


def positions(packed):
    parts = numbers(packed["positions"], "<u2").reshape(-1, 3) / 65535
    return np.array(packed["low"]) + parts * packed["size"]


def facts(photos=3, failed=(), seen=0.99, error=0.5, **color):
    quality = {"seen": seen, "seen_by_one": 0.02, "photos_per_point": 2.5, "photos": []}
    rows = [
        {
            "file": f"{k}.jpg", "size": [1000, 800],
            "status": "failed" if k in failed else "registered",
            "quality": {} if k in failed else {"expected_error_px": error},
        }
        for k in range(photos)
    ]  # fmt: skip
    return {
        "summary": {"photos": photos, "registered": photos - len(failed), "failed": len(failed)},
        "photos": rows,
        "outdated": "",
        "color": {"quality": quality | color, "failed": {}, "occluders": {}},
    }


def test_the_verdict_follows_from_the_numbers():
    """Good where nothing is left to do; else what to do is said, with names."""
    assert verdict(facts())["level"] == "good"
    assert "99.0 %" in verdict(facts())["text"]
    failed = verdict(facts(failed=(1,)))
    assert failed["level"] == "fair" and "1.jpg" in failed["next"][0]
    assert "2 of 3" in failed["text"]
    assert verdict(facts(seen=0.5))["level"] == "bad"
    assert verdict(facts(error=9.0))["level"] == "bad"
    assert any("20.0 %" in step for step in verdict(facts(seen=0.8))["next"])
    untold = verdict(facts(error=None))
    assert untold["level"] == "fair" and "not known" in untold["next"][0]
    none = verdict(facts(failed=(0, 1, 2)) | {"color": None})
    assert none["level"] == "bad" and "no model yet" in none["text"]


def test_a_packed_model_is_the_model():
    """Positions to 1/65535 of its size, faces by page, places on the page from its top left."""
    mesh = plane(cells=4, half=3.0)
    uv = np.array([[0.0, 1.0], [1.0, 1.0], [0.25, 0.5]])
    page_of_face = np.arange(len(mesh.faces), dtype=np.int32) % 2 - 1
    pages = (np.full((8, 8, 3), 200, np.uint8),)
    uv_faces = np.tile(np.arange(3, dtype=np.int32), (len(mesh.faces), 1))
    model = TexturedMesh(mesh.vertices, mesh.faces, uv, uv_faces, page_of_face, pages)

    packed = packed_model(model, UP, FRONT)

    assert [page["count"] for page in packed["pages"]] == [16, 16]
    assert packed["pages"][0]["image"] is None
    assert packed["pages"][1]["image"].startswith("data:image/jpeg;base64,")
    faces = np.cumsum(numbers(packed["faces"], "<i4")).reshape(-1, 3)
    order = np.argsort(page_of_face, kind="stable")
    np.testing.assert_allclose(
        positions(packed)[faces], mesh.vertices[mesh.faces[order]], atol=6 / 65535
    )
    places = numbers(packed["uv"], "<u2").reshape(-1, 2) / 65535
    np.testing.assert_allclose(places[faces[20, 2]], (0.25, 0.5), atol=1e-4)


def test_a_large_model_is_packed_lighter(monkeypatch):
    """Of more faces than a page can draw, about as many are left as it can, with their colors."""
    monkeypatch.setattr(report_model, "MOST_FACES", 200)
    mesh = plane(cells=40)
    colors = np.where(mesh.vertices[:, :1] > 0, [200, 10, 10], [10, 10, 200]).astype(np.uint8)

    packed = packed_model(ColoredMesh(mesh.vertices, mesh.faces, colors), UP, FRONT)

    assert 80 < packed["pages"][0]["count"] < 400
    at, rgb = positions(packed), numbers(packed["colors"], "u1").reshape(-1, 3)
    right, left = at[:, 0] > 0.2, at[:, 0] < -0.2
    assert (rgb[right, 0] > 190).all() and (rgb[left, 2] > 190).all()


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The report of a wall that four photos show."""
    root = tmp_path_factory.mktemp("wall")
    project_of(root, photos())
    colored(root)
    with Workbench(Project.open(root)) as bench:
        return report_project(bench).files[0]


def test_one_file_without_a_network(page):
    """Nothing in it points elsewhere; each photo has the model beside it."""
    text = page.read_text()

    assert text.index('class="verdict') < text.index("<table>")
    assert "http://" not in text and "https://" not in text
    assert text.count('class="wipe"') == 4
    assert "up is y, by the settings" in text
    assert "<<<<<<<" not in text and ">>>>>>>" not in text  # what a merge leaves to be settled
    assert text.count("<th>made by</th>") == 1


def test_the_model_is_drawn_and_turns(page, browser):
    """In a browser without a network, the wall is there, and another side of it after some keys."""
    if 'type="module"' not in page.read_text():
        pytest.skip("the page is not built (python hatch_build.py)")
    context = browser.new_context(offline=True)
    tab, faults = context.new_page(), []
    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.goto(page.as_uri())
    tab.wait_for_selector("canvas[data-drawn=yes]")
    canvas = tab.locator("#model")
    before = canvas.screenshot()
    canvas.focus()
    for _ in range(4):
        tab.keyboard.press("ArrowRight")
    tab.wait_for_timeout(300)
    after = canvas.screenshot()
    context.close()

    assert faults == []
    assert len(before) > 10_000 and before != after


def test_only_what_changed_is_drawn_anew(tmp_path, monkeypatch):
    """Where nothing changed but the report is gone, nothing is; after a photo changed, it alone is,
    and the model not, since it was not made again. That it is older than the photo is said.
    """
    project_of(tmp_path, photos())
    colored(tmp_path)
    drawn = []
    for made in ("_overlay", "_of_model"):
        real = getattr(depicting, made)

        def watched(bench, *given, made=made, real=real):
            drawn.append(given[0] if made == "_overlay" else made)
            return real(bench, *given)

        monkeypatch.setattr(depicting, made, watched)

    def report():
        drawn.clear()
        with Workbench(Project.open(tmp_path)) as bench:
            return report_project(bench).files

    report()
    assert sorted(drawn) == ["0.png", "1.png", "2.png", "3.png", "_of_model"]
    (tmp_path / "out/report.html").unlink()
    report()
    assert drawn == []
    path = tmp_path / "photos/2.png"
    path.write_bytes((tmp_path / "photos/1.png").read_bytes())
    told = json.loads(report()[1].read_text())
    assert drawn == ["2.png"]
    assert "2.png" in told["outdated"] and "older" in told["verdict"]["next"][0]


def test_numbers_are_told_in_words():
    """Parts as percent of what they are parts of; no exposure that is none; a note of many photos
    once.
    """
    told = dict(details({"seen": 0.932, "photos_per_point": 6.96, "photos": [], "scale": 1.0}))
    assert told["seen"] == "93.2 % of the surface is seen by a photo"
    assert told["seen by"] == "7.0 photos on the mean"
    row = {"gain": [1, 1.5, 0.25], "exposure_off": -0.04, "sharpness": None, "share": 0.25}
    assert light_of(row) == "gain 1.00, 1.50, 0.25; gives 25 % of the color"
    assert "0.3 stops darker" in light_of(row | {"exposure_off": 0.31})
    rows = [{"file": f"{k}.jpg", "notes": ["no EXIF"] + ["dark"] * (k == 1)} for k in range(5)]
    assert shared_notes(rows) == {"no EXIF": "all photos"}
    assert shared_notes([*rows, {"file": "x", "notes": []}]) == {
        "no EXIF": "0.jpg, 1.jpg, 2.jpg and 2 more"
    }
