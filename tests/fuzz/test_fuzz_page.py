"""Whatever a client sends to the page's server, and whatever lies in the project, no address fails.

TEXPROJ_FUZZ_INPUTS=500 python -m pytest tests/fuzz/test_fuzz_page.py --hypothesis-profile=long
"""

import asyncio
import json
import sys
from pathlib import Path
from urllib.parse import quote

import httpx
import numpy as np
import pytest
from fuzzing import INPUTS, ODD_VALUES, broken_bytes, broken_json, broken_value
from hypothesis import given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import preview_project
from preview_project import HEIGHT, WIDTH, corner_points, make_project

from texproj.options import PreviewOptions
from texproj.preview import app as app_module
from texproj.preview import work
from texproj.preview.photos import camera_facts
from texproj.preview.session import Session

PHOTO = "0000.png"
WORDS = ("", ".", "..", "a/b", "../../etc/passwd", "\0", "é", "x" * 3000, "NaN", PHOTO, "9999.jpg")
JSON = {"content-type": "application/json"}
ALLOWED = {200, 202, 204, 303, 307, 400, 401, 403, 404, 405, 409, 413, 415, 422, 429}


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A client of one project whose long work ends at once."""
    folder = tmp_path_factory.mktemp("page")
    plain = np.full((HEIGHT, WIDTH), 90, np.uint8)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(preview_project, "photographs", lambda: [plain] * 4)
        views = make_project(folder / "blocks")
    (folder / "bundle").mkdir()
    for name in app_module.BUNDLE:
        (folder / "bundle" / name).write_text("")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(app_module, "bundle_folder", lambda: folder / "bundle")
        patch.setattr(work, "STAGES", {name: (name, nothing) for name in work.STAGES})
        patch.setattr(work, "register_photos", nothing)
        session = Session(folder / "blocks", PreviewOptions())
        door = httpx.ASGITransport(app_module.create_app(session), raise_app_exceptions=False)
        with asyncio.Runner() as runner:
            client = httpx.AsyncClient(transport=door, base_url="http://127.0.0.1")
            yield Place(client, runner, folder / "blocks", views)
            runner.run(client.aclose())
        session.close()


class Place:
    """The client, and sound requests to begin from."""

    def __init__(self, client, runner, root, views):
        self.client, self.runner, self.root = client, runner, root
        uv, xyz = corner_points(views[0], 8)
        rows = enumerate(zip(uv.tolist(), xyz.tolist(), strict=True))
        self.picks = [{"name": str(i), "uv": a, "xyz": b} for i, (a, b) in rows]
        self.camera = camera_facts(views[0])
        self.point = {"camera": self.camera, "xyz": xyz[0].tolist()}
        rows = [f"{a},{b},{x},{y},{z},p{i}" for i, ((a, b), (x, y, z)) in enumerate(zip(
            uv.tolist(), xyz.tolist(), strict=True))]  # fmt: skip
        (root / "correspondences/0001.csv").write_text("\n".join(["u,v,x,y,z,name", *rows]))
        self.pixel = {"camera": self.camera, "uv": uv[0].tolist()}

    def ask(self, method, path, **more):
        """Fails for an answer that is a fault, or a refusal without a sentence."""
        answer = self.runner.run(self.client.request(method, path, **more))
        INPUTS["page"] += 1
        assert answer.status_code in ALLOWED, (method, path, answer.text)
        if answer.status_code >= 400 and answer.status_code != 409:  # a conflict tells the picks
            assert 0 < len(answer.json()["error"]) < 2000
        return answer


def nothing(*_, **__):
    """Work that is done at once."""


PICKS = [{"name": "1", "uv": [1, 2], "xyz": [1, 2, 3]}]
BODIES = {
    ("POST", "/api/hit"): {"origin": [0, 0, 5], "direction": [0, 0, -1]},
    ("POST", "/api/jobs"): {"kind": "solve", "photo": PHOTO},
    ("PUT", f"/api/photos/{PHOTO}/picks"): {"picks": PICKS, "base": "none"},
    ("PUT", f"/api/photos/{PHOTO}/excluded"): {"excluded": False},
    ("PUT", "/api/up"): {"axis": "-y"},
    ("PATCH", "/api/settings"): {
        "base": "",
        "changes": [{"table": "color", "key": "bits", "value": 16}],
    },
    ("POST", f"/api/photos/{PHOTO}/mask"): {
        "base": "",
        "kind": "paint",
        "radius": 5,
        "points": [[1, 2], [30, 40]],
    },
}


@given(st.data())
def test_bodies(page, data):
    """Odd values in place of any part of a sound body; JSON that is cut, nested, endless."""
    sound = {
        **BODIES,
        ("POST", f"/api/photos/{PHOTO}/fit"): {"picks": page.picks, "without": ["1"]},
        ("POST", f"/api/photos/{PHOTO}/proposals"): {
            "camera": page.camera,
            "error_px": 2.0,
            "picks": page.picks[:2],
        },
        ("POST", f"/api/photos/{PHOTO}/predict"): data.draw(
            st.sampled_from([page.point, page.pixel])
        ),
    }
    for (method, path), told in sound.items():
        there = page.ask("GET", path).json() if "base" in told else {}
        body = {**told, "base": there["version"]} if "version" in there else told
        page.ask(method, path, content=data.draw(broken_json([body])), headers=JSON)


@given(st.data())
def test_addresses(page, data):
    """Odd words in place of names of photos, layers, models, sizes and jobs."""
    word = quote(data.draw(st.sampled_from(WORDS) | st.text(max_size=20).filter(_sendable)))
    size = quote(str(data.draw(st.sampled_from(ODD_VALUES))).encode("utf-8", "replace"))
    for path in (
        f"/{word}", f"/static/{word}", f"/api/mesh/{word}", f"/api/layers/{word}?photo={word}",
        f"/api/models/{word}", f"/api/photos/{word}/image?size={size}", f"/api/photos/{word}/picks",
        f"/api/layers/weights?photo={size}", f"/api/photos/{word}/mask", f"/report/{word}",
        f"/api/photos/{word}/mask/picture", f"/api/photos/{word}/partners",
    ):  # fmt: skip
        page.ask("GET", path)
    page.ask("DELETE", f"/api/jobs/{word}")


def _sendable(text):
    return text.isprintable() and text.encode("utf-8", "replace").decode() == text


GLB = b"glTF\x02\0\0\0\x60\0\0\0\x4c\0\0\0JSON" + json.dumps(
    {"asset": {"version": "2.0"}, "extensionsRequired": [], "meshes": []}
).encode().ljust(76)
PLY = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n" + (
    b"property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    b"end_header\n1 2 3 4 5 6\n"
)


@given(st.data())
def test_files(page, data):
    """Whatever stands in the files that the page reads, it says so and goes on."""
    sound = json.loads((page.root / "cameras.json").read_text())
    files = {
        "out/model.glb": (data.draw(broken_bytes([GLB])), "/api/colors/light"),
        "out/model.ply": (data.draw(broken_bytes([PLY])), "/api/colors"),
        "correspondences/0001.csv": (
            data.draw(broken_bytes([b"u,v,x,y,z,name\n1,2,3,4,5,a\n"])),
            "/api/photos/0001.png/picks",
        ),
        "project.toml": (data.draw(broken_bytes([b'photos = "photos"\n'])), "/api/mesh/full"),
    }
    (page.root / "out").mkdir(exist_ok=True)
    kept = (page.root / "cameras.json").read_bytes()
    broken = json.dumps(data.draw(broken_value([sound])), default=str).encode()
    try:
        (page.root / "cameras.json").write_bytes(broken)
        page.ask("GET", "/api/project")
        (page.root / "cameras.json").write_bytes(kept)
        for name, (content, path) in files.items():
            (page.root / name).write_bytes(content)
            page.ask("GET", "/api/project")
            page.ask("GET", path)
            (page.root / name).unlink()
    finally:
        (page.root / "cameras.json").write_bytes(kept)
        for name in files:
            (page.root / name).unlink(missing_ok=True)


def test_a_glb_that_requires_a_number_is_shown(page):
    """The seed of a page that did not open: "extensionsRequired": 5."""
    text = json.dumps({"asset": {"version": "2.0"}, "extensionsRequired": 5}).encode().ljust(76)
    path = page.root / "out/model.glb"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(GLB[:20] + text)
    answer = page.ask("GET", "/api/project")
    path.unlink()

    assert answer.status_code == 200


def test_a_glb_whose_text_is_not_utf_8_is_a_sentence(page):
    """The seed of a fault of the server: trimesh asks for a package that guesses encodings."""
    path = page.root / "out/model.glb"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(GLB[:20] + b"\xff\xfe" + GLB[20:-2])
    answer = page.ask("GET", "/api/colors/light")
    path.unlink()

    assert answer.status_code == 422


def test_a_folder_in_place_of_picks_is_a_sentence(page):
    """Reading and writing name it; the page goes on."""
    folder = page.root / "correspondences/0002.csv"
    folder.mkdir()
    read = page.ask("GET", "/api/photos/0002.png/picks")
    written = page.ask("PUT", "/api/photos/0002.png/picks", json={"picks": PICKS, "base": "none"})
    facts = page.ask("GET", "/api/project")
    folder.rmdir()

    assert "0002.csv" in read.json()["error"]
    assert written.status_code == 422
    assert facts.status_code == 200
