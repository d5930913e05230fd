"""The page's server: what it answers, whom it refuses, and that nobody's work is lost."""

import io
import json
import os
import shutil
import threading
import time
import zipfile
from contextlib import contextmanager
from pathlib import Path

import httpx
import numpy as np
import pytest
from preview_project import BROKEN, cameras, corner_points, running

from texproj.files import file_hash
from texproj.formats.models import write_ply
from texproj.options import PreviewOptions
from texproj.preview import app as app_module
from texproj.preview import work
from texproj.preview.geometry import pack, simplified
from texproj.preview.jobs import MOST_JOBS, Clock, TooManyJobs
from texproj.preview.photos import record_facts
from texproj.preview.session import Session
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.attending import INTERNAL

PHOTO = "0000.png"
CHECKOUT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def root(server_template, tmp_path_factory):
    """One project for all tests that do not write."""
    return shutil.copytree(server_template, tmp_path_factory.mktemp("project") / "blocks")


@pytest.fixture(scope="module", autouse=True)
def bundle(tmp_path_factory):
    """A stand-in for the built page: these tests are about the server."""
    folder = tmp_path_factory.mktemp("bundle")
    for name in app_module.BUNDLE:
        (folder / name).write_text(f"<!-- {name} -->")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(app_module, "bundle_folder", lambda: folder)
        yield


@contextmanager
def client(root, token=None, **options):
    """Real requests to a real server."""
    with running(root, token, **options) as home, httpx.Client(base_url=home, timeout=60) as found:
        yield found


def own_name(page, name="127.0.0.1"):
    """A Host header of this server under `name`."""
    return f"{name}:{page.base_url.port}"


@pytest.fixture(scope="module")
def page(root):
    """One server for all tests that do not write."""
    with client(root) as found:
        yield found


@pytest.fixture
def own(server_template, tmp_path):
    """A project to write in, and its client."""
    shutil.copytree(server_template, tmp_path / "own")
    with client(tmp_path / "own") as found:
        yield tmp_path / "own", found


def unpacked(content, name):
    """An array of a pack, read by the layout that its module documents."""
    length = int.from_bytes(content[:4], "little")
    entry = json.loads(content[4 : 4 + length])["arrays"][name]
    start = 4 + length + entry["offset"]
    count = int(np.prod(entry["shape"]))
    return np.frombuffer(content, entry["dtype"], count, start).reshape(entry["shape"])


# --- what it says


def test_every_photo_has_a_verdict_and_an_advice(page):
    """Registered, weak, prior and broken photos are told apart, with reason and what to do."""
    photos = {p["name"]: p for p in page.get("/api/project").json()["photos"]}

    assert photos["0000.png"]["status"] == "registered"
    assert not photos["0000.png"]["weak"]
    assert photos["0002.png"]["weak"]
    assert photos["0002.png"]["advice"] == "Pick 8 points."
    assert photos["0003.png"]["status"] == "prior"
    assert photos[BROKEN]["status"] == "broken"
    assert BROKEN in photos[BROKEN]["reason"]


def test_what_to_do_is_told_once():
    """A reason that says to pick points needs no advice to do so."""
    told = [
        record_facts(
            CameraRecord("a", 60, 40, None, None, "failed", None, {"reason": reason}), picks
        )["advice"]
        for reason, picks in [("it is torn; pick 8 points", 0), ("pick 8 points", 3), ("torn", 0)]
    ]

    assert told == ["", "Pick 5 more points.", "Pick 8 points."]


def test_the_mesh_arrives_bit_by_bit(page, root):
    """Positions are the file's in float32 about the center; faces are the same."""
    mesh = Project.open(root).load_mesh().mesh
    content = page.get("/api/mesh/full").content

    assert np.array_equal(unpacked(content, "faces"), mesh.faces)
    expected = (mesh.vertices - mesh.center).astype(np.float32)
    assert np.array_equal(unpacked(content, "positions"), expected)


def test_the_light_mesh_stays_on_the_surface():
    """A tenth of the faces, each vertex within 2 % of the diagonal of the vertex it is tied to."""
    import trimesh

    from texproj.mesh import Mesh

    ball = trimesh.creation.icosphere(5, 3.0)
    mesh = Mesh(ball.vertices, ball.faces.astype(np.int32))
    light = simplified(mesh, 2000)

    assert 1500 <= len(light.mesh.faces) <= 2000
    assert np.abs(np.linalg.norm(light.mesh.vertices, axis=1) - 3).max() < 0.02
    apart = np.linalg.norm(light.mesh.vertices - mesh.vertices[light.vertex_of_light], axis=1)
    assert apart.max() < 0.02 * mesh.diagonal
    assert simplified(mesh, len(mesh.faces)) is None


def test_packed_arrays_start_at_multiples_of_four():
    """A browser can only look at aligned numbers."""
    data = pack({"a": np.arange(3, dtype=np.uint8), "b": np.arange(2, dtype=np.float32)}, x=1)

    assert np.array_equal(unpacked(data, "b"), [0, 1])
    assert int.from_bytes(data[:4], "little") % 4 == 0


def test_a_photo_is_served_as_jpeg_of_the_asked_size(page):
    """Whatever the file is, the browser gets a JPEG."""
    answer = page.get(f"/api/photos/{PHOTO}/image?size=240")

    assert answer.headers["content-type"] == "image/jpeg"
    assert answer.content[:2] == b"\xff\xd8"
    assert page.get(f"/api/photos/{PHOTO}/image?size=12345").status_code == 404


def test_what_is_made_can_be_downloaded(own, tmp_path):
    """An obj comes with its material and images, in one file; a film of an earlier model is none;
    nothing outside of the project is given away."""
    root, page = own
    (root / "out").mkdir()
    for name in ("turntable.webp", "model.obj", "model.mtl", "model_0.png", "model_1.png"):
        (root / "out" / name).write_text(name)
    os.utime(root / "out/turntable.webp", (1, 1))
    found = page.get("/api/project").json()["downloads"]
    assert [one["word"] for one in found] == ["obj"]
    answer = page.get("/api/downloads/model.obj")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as packed:
        told = {name: packed.read(name).decode() for name in packed.namelist()}
    os.utime(root / "out/turntable.webp")
    words = [one["word"] for one in page.get("/api/project").json()["downloads"]]
    (tmp_path / "secret").write_text("secret")
    (root / "out/model.ply").symlink_to(tmp_path / "secret")

    assert told == {n: n for n in ("model.obj", "model.mtl", "model_0.png", "model_1.png")}
    assert 'filename="own-obj.zip"' in answer.headers["content-disposition"]
    assert words == ["obj", "film"]
    assert page.get("/api/downloads/model.ply").status_code == 403
    assert page.get("/api/downloads/report.json").status_code == 404


def test_base_colors_are_those_of_the_appearance(own):
    """Where no photo looks, there are none; and so are the numbers of the material."""
    root, page = own
    assert page.get("/api/colors/base").status_code == 422
    source = Project.open(root).load_mesh()
    count = len(source.source_vertices)
    rgb = np.random.default_rng(0).integers(0, 256, (count, 3), np.uint8)
    known = (np.arange(count) % 3 > 0).astype(np.float32)
    (root / "out").mkdir()
    write_ply(
        root / "out/appearance.ply", source.source_vertices, source.source_faces, rgb, None, (),
        {"confidence": known, "roughness": known * rgb[:, 0] / 255},
    )  # fmt: skip
    rgba = unpacked(page.get("/api/colors/base").content, "rgba")
    kept = source.vertex_of_source >= 0

    np.testing.assert_array_equal(rgba[source.vertex_of_source[kept], :3], rgb[kept])
    np.testing.assert_array_equal(rgba[source.vertex_of_source[kept], 3], 255 * known[kept])
    values = unpacked(page.get("/api/layers/roughness").content, "values")
    wanted = np.where(known > 0, rgb[:, 0] / 255, -1)
    np.testing.assert_allclose(values[source.vertex_of_source[kept]], wanted[kept], atol=1e-6)
    assert page.get("/api/layers/metallic").status_code == 422


def test_a_ray_meets_the_surface_exactly(page):
    """Straight down on the plate's top (z = 0.1): to 1e-9, not to float32."""
    ray = {"origin": [1.93, 1.43, 7.0], "direction": [0, 0, -2]}
    hit = page.post("/api/hit", json=ray).json()

    assert np.allclose(hit["xyz"], [1.93, 1.43, 0.1], atol=1e-9)
    assert np.allclose(hit["normal"], [0, 0, 1])
    assert page.post("/api/hit", json={**ray, "direction": [0, 0, 1]}).json() is None


def test_coverage_counts_the_photos_that_see(page):
    """The top of the plate is seen by several of the 3 registered photos, its underside by none."""
    values = unpacked(page.get("/api/layers/coverage").content, "values")
    positions = unpacked(page.get("/api/mesh/full").content, "positions")

    assert values.max() == 3
    assert values[positions[:, 2] == positions[:, 2].min()].max() == 0


def test_weights_of_a_photo_without_camera_are_refused(page):
    """With a sentence that names it."""
    answer = page.get("/api/layers/weights?photo=0003.png")

    assert answer.status_code == 422
    assert "0003.png is not registered" in answer.json()["error"]


def test_a_weight_comes_apart_into_its_factors(page):
    """Factors of a photo are 0 on the underside; without a mask nothing that is seen is masked."""
    positions = unpacked(page.get("/api/mesh/full").content, "positions")
    below = positions[:, 2] == positions[:, 2].min()
    for factor in ("angle", "consistency"):
        values = unpacked(page.get(f"/api/layers/{factor}?photo={PHOTO}").content, "values")

        assert values[below].max() == 0
        assert 0.3 < values.max() <= 1

    masked = unpacked(page.get(f"/api/layers/mask?photo={PHOTO}").content, "values")
    assert set(masked) == {0, 1}
    assert page.get("/api/layers/angle?photo=0003.png").status_code == 422


# --- picking


def picks_of(camera, count, noise=0.0):
    uv, xyz = corner_points(camera, count)
    return [
        {"name": str(i + 1), "uv": (a + noise).tolist(), "xyz": b.tolist()}
        for i, (a, b) in enumerate(zip(uv, xyz, strict=True))
    ]


def test_picks_are_on_disk_as_they_are_on_screen(own):
    """PUT writes the CSV; GET gives the same numbers, bit by bit, with normals."""
    root, page = own
    picks = picks_of(cameras()[0], 3)
    page.put(f"/api/photos/{PHOTO}/picks", json={"picks": picks, "base": "none"})
    read = page.get(f"/api/photos/{PHOTO}/picks").json()["picks"]

    assert [(p["name"], p["uv"], p["xyz"]) for p in read] == [
        (p["name"], p["uv"], p["xyz"]) for p in picks
    ]
    saved = Project.open(root).load_correspondences(PHOTO)
    assert saved.xy_px.tolist() == [p["uv"] for p in picks]
    assert np.allclose(np.linalg.norm([p["normal"] for p in read], axis=1), 1)


def test_two_pages_do_not_overwrite_each_other(own):
    """Who saves on an old version gets 409 and what is there; nothing is written."""
    root, page = own
    address = f"/api/photos/{PHOTO}/picks"
    mine, theirs = picks_of(cameras()[0], 2), picks_of(cameras()[0], 5)
    first = page.put(address, json={"picks": theirs, "base": "none"})
    second = page.put(address, json={"picks": mine, "base": "none"})

    assert first.status_code == 200
    assert second.status_code == 409
    assert second.json()["version"] == first.json()["version"]
    assert len(second.json()["picks"]) == 5
    assert len(Project.open(root).load_correspondences(PHOTO)) == 5
    again = page.put(address, json={"picks": mine, "base": second.json()["version"]})
    assert again.status_code == 200


def test_an_edit_from_outside_is_a_new_version(own):
    """A text editor counts as another page."""
    root, page = own
    address = f"/api/photos/{PHOTO}/picks"
    saved = page.put(address, json={"picks": picks_of(cameras()[0], 2), "base": "none"}).json()
    with (root / "correspondences" / "0000.csv").open("a") as file:
        file.write("1,2,3,4,5,by hand\n")
    answer = page.put(address, json={"picks": [], "base": saved["version"]})

    assert answer.status_code == 409
    assert answer.json()["picks"][-1]["name"] == "by hand"


@pytest.mark.parametrize(
    "picks",
    [
        "no list",
        [{"name": "1", "uv": [1], "xyz": [1, 2, 3]}],
        [{"name": "1", "uv": [1, "2"], "xyz": [1, 2, 3]}],
        [{"name": "", "uv": [1, 2], "xyz": [1, 2, 3]}],
        [{"name": "a\nb", "uv": [1, 2], "xyz": [1, 2, 3]}],
        [{"name": "1", "uv": [1, 2], "xyz": [1, 2, 3]}] * 2,
    ],
)
def test_unusable_picks_are_refused_in_words(own, picks):
    """Nothing is written."""
    root, page = own
    answer = page.put(f"/api/photos/{PHOTO}/picks", json={"picks": picks, "base": "none"})

    assert answer.status_code == 400
    assert answer.json()["error"]
    assert not list((root / "correspondences").glob("*.csv"))


def test_the_fit_of_exact_picks_is_the_true_camera(page):
    """8 noiseless picks: residuals under 0.01 px, predictions on the picks."""
    picks = picks_of(cameras()[3], 8)
    fit = page.post("/api/photos/0003.png/fit", json={"picks": picks}).json()

    assert max(fit["residual_px"]) < 0.01
    assert np.allclose(fit["projected"], [p["uv"] for p in picks], atol=0.02)
    assert all(fit["inliers"])


def test_a_bad_pick_stands_out(page):
    """One pick moved by 40 px is the outlier, and only that one."""
    picks = picks_of(cameras()[3], 10)
    picks[4]["uv"] = [picks[4]["uv"][0] + 40, picks[4]["uv"][1]]
    fit = page.post("/api/photos/0003.png/fit", json={"picks": picks}).json()

    assert [name for name, ok in zip(fit["names"], fit["inliers"], strict=True) if not ok] == ["5"]
    assert 30 < fit["residual_px"][4] < 50


def test_predictions_go_both_ways(page):
    """Pixel to surface and surface to pixel, at the true camera, within the snap's 1.5 px."""
    camera = page.get("/api/project").json()["photos"][0]["camera"]
    (uv, *_), (xyz, *_) = corner_points(cameras()[0], 1)
    address = f"/api/photos/{PHOTO}/predict"
    on_photo = page.post(address, json={"camera": camera, "xyz": xyz.tolist()}).json()
    on_model = page.post(address, json={"camera": camera, "uv": uv.tolist()}).json()

    assert np.hypot(*(np.array(on_photo["uv"]) - uv)) < 1.5
    seen = cameras()[0].project([on_model["xyz"]])[0][0]
    assert np.hypot(*(seen - uv)) < 1.5


def test_a_snap_mends_a_wrong_prediction(page):
    """With the camera off by 6 px, most places are found again, half of them within 3 px."""
    camera = page.get("/api/project").json()["photos"][0]["camera"]
    camera["c"] = [camera["c"][0] + 6, camera["c"][1]]
    uv, xyz = corner_points(cameras()[0], 12)
    address, errors, kept = f"/api/photos/{PHOTO}/predict", [], 0
    for pixel, point in zip(uv, xyz, strict=True):
        found = page.post(address, json={"camera": camera, "xyz": point.tolist()}).json()
        if found["score"]:
            errors.append(np.hypot(*(np.array(found["uv"]) - pixel)))
        else:
            kept += 1

    assert len(errors) >= 6
    assert np.median(errors) < 3
    assert kept + len(errors) == 12


# --- jobs


def wait_for(check, seconds=60):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := check():
            return found
        time.sleep(0.05)
    raise AssertionError("waited in vain")


def test_solve_registers_one_photo_from_its_picks(own):
    """The job writes cameras.json; the camera is the true one within 0.1 px."""
    root, page = own
    picks = picks_of(cameras()[3], 10)
    page.put("/api/photos/0003.png/picks", json={"picks": picks, "base": "none"})
    job = page.post("/api/jobs", json={"kind": "solve", "photo": "0003.png"})
    assert job.status_code == 202
    record = wait_for(
        lambda: (r := Project.open(root).load_cameras()["0003.png"]).status == "registered" and r
    )

    assert record.method == "points"
    seen = record.camera.project([p["xyz"] for p in picks])[0]
    assert np.abs(seen - [p["uv"] for p in picks]).max() < 0.1


def test_a_job_can_be_stopped(root):
    """Work that listens ends as cancelled, and the next one runs."""
    session = Session(root, PreviewOptions())
    started = []

    def endless(progress):
        while True:
            started.append(1)
            progress("work", 0, 1, "")
            time.sleep(0.01)

    job, future = session.jobs.start("test", "Test", endless)
    wait_for(lambda: started)
    assert session.jobs.cancel(job.id)
    assert type(future.exception(5)).__name__ == "Cancelled"
    assert session.jobs.start("test", "Test", lambda progress: 7)[1].result(5) == 7
    assert not session.jobs.cancel(job.id)


def test_a_job_is_not_queued_twice_and_jobs_are_bounded(root):
    """200 requests for one job are one job; of 200 different ones no more than 16 wait."""
    session = Session(root, PreviewOptions())
    hold = threading.Event()
    same = {session.jobs.start("test", "Test", lambda _: hold.wait())[0].id for _ in range(200)}
    assert len(same) == 1
    with pytest.raises(TooManyJobs, match="wait already"):
        for number in range(200):
            session.jobs.start("test", "Test", lambda _: None, str(number))
    assert len(session.jobs.active) == MOST_JOBS
    hold.set()
    wait_for(lambda: not session.jobs.active)
    session.close()


def test_a_stopped_job_can_be_asked_for_again(root):
    """While the old one still ends, the new one waits for its turn and is not taken for it."""
    session = Session(root, PreviewOptions())
    hold = threading.Event()
    first, _ = session.jobs.start("test", "Test", lambda _: hold.wait())
    session.jobs.cancel(first.id)
    second, future = session.jobs.start("test", "Test", lambda _: "made")
    hold.set()

    assert second.id != first.id
    assert future.result(5) == "made"
    session.close()


def test_an_unforeseen_fault_of_a_job_is_told_and_logged(own, monkeypatch):
    """The page is told where to look, the traceback is in the project's log, the next job runs."""
    root, page = own

    def fail(*_):
        raise ZeroDivisionError("of the test")

    monkeypatch.setattr(work, "STAGES", {"run": ("Make the model", fail)})
    with page.stream("GET", "/api/events") as news:
        lines = news.iter_lines()
        next(lines)
        page.post("/api/jobs", json={"kind": "run"})
        told = next(json.loads(line[6:]) for line in lines if '"failed"' in line)

    assert told["message"] == INTERNAL
    assert "ZeroDivisionError: of the test" in (root / "work/log/texproj.log").read_text()


def test_what_a_stage_still_takes_is_told_from_what_it_took(monkeypatch):
    """3 of 10 steps in 6 s: 14 s are left; another stage begins anew; nothing is told at once."""
    now = [100.0]
    monkeypatch.setattr("texproj.preview.jobs.time.monotonic", lambda: now[0])
    clock = Clock()
    assert clock.left_s("register", 0, 10) is None
    now[0] += 6
    assert clock.left_s("register", 3, 10) == pytest.approx(14)
    assert clock.left_s("color", 3, 10) is None


# --- the folder


def test_a_mesh_is_read_for_its_hash_once(root, monkeypatch):
    """However many requests there are; a photo that comes is seen, though."""
    hashed = []
    monkeypatch.setattr(
        "texproj.hashes.file_hash", lambda path: hashed.append(path) or file_hash(path)
    )
    session = Session(root, PreviewOptions())
    project = session.project
    for _ in range(5):
        session.facts()
        assert session.project is project
    assert sum(path.suffix == ".ply" for path in hashed) == 1
    new = root / "photos" / "new.png"
    shutil.copy(root / "photos" / PHOTO, new)
    try:
        assert new.name in session.project.photo_names
        session.facts()
        assert sum(path.suffix == ".ply" for path in hashed) == 1
    finally:
        new.unlink()
    session.close()


def test_who_only_looks_writes_nothing(own):
    """Pages, pictures, meshes, layers of the surface and of photos, rays and fits leave the folder
    as it was, by names, sizes and times.
    """
    root, page = own
    before = looks(root)
    for path in ("project", "mesh/full", "mesh/light", "layers/ao", "layers/coverage",
                 f"layers/angle?photo={PHOTO}", f"photos/{PHOTO}/image?size=1600",
                 f"photos/{PHOTO}/picks"):  # fmt: skip
        assert page.get(f"/api/{path}").status_code in (200, 204)
    page.post("/api/hit", json={"origin": [0, 0, 5], "direction": [0, 0, -1]})
    page.post(f"/api/photos/{PHOTO}/fit", json={"picks": picks_of(cameras()[0], 8)})

    assert looks(root) == before


def looks(root):
    """Time and size of everything in a folder."""
    return {p: (p.stat().st_mtime_ns, p.stat().st_size) for p in root.rglob("*")}


def test_a_file_that_is_written_is_told_at_once(own):
    """Picks written by another program, and a folder that was not there when the server began."""
    root, page = own
    with page.stream("GET", "/api/events") as news:
        lines = news.iter_lines()
        next(lines)
        time.sleep(0.5)
        (root / "correspondences" / "0000.csv").write_text("u,v,x,y,z\n")
        told = next(line for line in lines if "changed" in line)
        assert "correspondences/0000.csv" in told
        (root / "out").mkdir()
        time.sleep(0.5)
        (root / "out" / "model.ply").write_text("x")
        assert any("out/model.ply" in line for line in lines if "changed" in line)


@pytest.mark.parametrize("back", [True, False])
def test_a_ray_says_whether_it_meets_the_back(page, back):
    """From inside of the plate its top is seen from behind."""
    below, above = [1.93, 1.43, 0.05], [1.93, 1.43, 2.0]
    origin, way = (below, 1) if back else (above, -1)
    hit = page.post("/api/hit", json={"origin": origin, "direction": [0, 0, way]}).json()

    assert hit["back"] is back


@pytest.mark.parametrize("place", ["1", 1.5, True, [1]])
def test_a_place_that_is_no_number_is_refused(page, place):
    """No work is started; and where nothing was asked, nothing is shown."""
    answer = page.post("/api/jobs", json={"kind": "place", "place": place})

    assert answer.status_code == 400
    assert page.get("/api/places").json() == {"draft": None, "question": None}


def test_unknown_work_is_refused(page):
    """With the list of what there is."""
    answer = page.post("/api/jobs", json={"kind": "rm"})

    assert answer.status_code == 400
    assert "solve" in answer.json()["error"]


# --- security


def test_answers_carry_the_fixed_headers(page):
    """Content Security Policy without inline code, no sniffing, no framing, fixed types."""
    for address in ("/", "/static/app.js", "/api/project", "/nothing"):
        headers = page.get(address).headers
        policy = headers["content-security-policy"]

        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cross-origin-resource-policy"] == "same-origin"
    assert page.get("/static/app.js").headers["content-type"].startswith("text/javascript")


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:PORT", "127.0.0.1:80", "127.0.0.1.evil.example:PORT",
     "localhost:PORT@evil.example", "", "10.0.0.7:PORT", "[::1", "127.0.0.1:PORT/x"],
)  # fmt: skip
def test_other_host_names_are_refused(page, host):
    """A rebound name reaches the server but gets nothing."""
    host = host.replace("PORT", str(page.base_url.port))

    assert page.get("/api/project", headers={"host": host}).status_code in (400, 403)


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1", "[::1]"])
def test_own_names_are_served(page, name):
    """All names of the loopback."""
    host = own_name(page, name)

    assert page.get("/api/project", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [{"origin": "http://evil.example"}, {"origin": "null"}, {"origin": "http://127.0.0.1:9999"},
     {"origin": "https://127.0.0.1:PORT"}, {"sec-fetch-site": "cross-site"},
     {"sec-fetch-site": "same-site"}],
)  # fmt: skip
@pytest.mark.parametrize("method", ["GET", "POST", "PUT", "DELETE"])
def test_other_sites_are_refused(page, headers, method):
    """Neither reading nor writing, by form, script or image."""
    headers = {k: v.replace("PORT", str(page.base_url.port)) for k, v in headers.items()}
    answer = page.request(method, "/api/jobs", headers=headers, json={"kind": "register"})

    assert answer.status_code == 403


def test_a_link_to_the_page_may_be_followed(page):
    """Navigation from elsewhere is what links are for."""
    headers = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}

    assert page.get("/", headers=headers).status_code == 200


def test_forms_are_not_read(page):
    """Only JSON, which a foreign form cannot send without asking first."""
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data"):
        answer = page.post("/api/jobs", content='{"kind":"run"}', headers={"content-type": kind})
        assert answer.status_code == 415


def test_long_requests_are_refused(root):
    """By their declared length, and by what really comes."""
    with client(root, max_request_bytes=1000) as page:
        address = f"/api/photos/{PHOTO}/picks"
        declared = page.put(address, content=b"{" + b" " * 2000 + b"}",
                            headers={"content-type": "application/json"})  # fmt: skip
        chunks = iter([b"{", *[b" " * 400] * 5, b"}"])
        streamed = page.put(address, content=chunks, headers={"content-type": "application/json"})

        assert declared.status_code == 413
        assert streamed.status_code == 413


@pytest.mark.parametrize(
    "path",
    ["/static/../../../pyproject.toml", "/static/..%2f..%2fapp.py", "/static/%2e%2e/app.py",
     "/static/sources.sha256", "/api/models/..%2fcameras.json", "/api/models/report.html",
     "/api/photos/..%2f..%2fetc%2fpasswd/image", "/api/photos/%2e%2e/image",
     "/api/photos/..%5c..%5cx/picks", "/api/photos/nothing.png/picks"],
)  # fmt: skip
def test_no_path_leaves_the_project(page, path):
    """Dots, encoded dots and slashes, other files: not found."""
    assert page.get(path).status_code == 404


def test_links_out_of_the_project_are_not_followed(own, tmp_path):
    """A linked model or linked picks would show or overwrite a file elsewhere."""
    root, page = own
    secret = tmp_path / "secret.csv"
    secret.write_text("u,v,x,y,z\n")
    (root / "out").mkdir()
    (root / "out" / "model.glb").symlink_to(secret)
    (root / "correspondences" / "0000.csv").symlink_to(secret)
    saved = page.put(f"/api/photos/{PHOTO}/picks", json={"picks": [], "base": "none"})

    assert page.get("/api/models/model.glb").status_code == 403
    assert page.get(f"/api/photos/{PHOTO}/picks").status_code == 403
    assert saved.status_code == 403
    assert secret.read_text() == "u,v,x,y,z\n"


def test_a_model_that_draco_compressed_comes_open(own):
    """The page gets the same model without the extension; one that is cut off is one sentence."""
    root, page = own
    (root / "out").mkdir()
    sample = CHECKOUT / "tests/meshes/gltf-transform.glb"
    (root / "out/model.glb").write_bytes(sample.read_bytes())
    answer = page.get("/api/models/model.glb")
    assert answer.status_code == 200
    assert answer.content[:4] == b"glTF" and b"draco" not in answer.content
    assert len(answer.content) > 2 * len(sample.read_bytes())
    (root / "out/model.glb").write_bytes(sample.read_bytes()[:-500])
    answer = page.get("/api/models/model.glb")
    assert (answer.status_code, "damaged" in answer.text) == (422, True)


def test_a_setting_names_only_what_is_in_the_project(own):
    """A chart elsewhere would be shown, or colors made from it; what is no number is refused."""
    page = own[1]
    base = page.get("/api/settings").json()["version"]
    for table, key in (("color", "checker"), ("light", "gray")):
        for path in ("/etc/passwd", "../own.png", "nothing.png"):
            changes = [{"table": table, "key": key, "value": path}]
            answer = page.patch("/api/settings", json={"changes": changes, "base": base})
            assert (answer.status_code, "in the project" in answer.text) == (400, True)
    changes = [{"table": "color", "key": "bits", "value": float("nan")}]
    text = json.dumps({"changes": changes, "base": base})
    answer = page.patch("/api/settings", content=text, headers={"content-type": "application/json"})

    assert (answer.status_code, "cannot have that value" in answer.text) == (400, True)
    assert page.get("/api/settings").json()["version"] == base


def test_the_place_of_a_lamp_has_a_field(own):
    """Three numbers; two, or words, are none."""
    root, page = own

    def answered(value):
        base = page.get("/api/settings").json()["version"]
        changes = [{"table": "light", "key": "position", "value": value}]
        return page.patch("/api/settings", json={"changes": changes, "base": base}).status_code

    (light,) = (t for t in page.get("/api/settings").json()["tables"] if t["name"] == "light")
    (lamp,) = (option for option in light["options"] if option["key"] == "position")
    assert (lamp["kind"], lamp["value"], lamp["default"]) == ("place", None, None)
    assert [answered(value) for value in ([0.1, 0.2], ["a", "b", "c"], [True, 0, 0])] == [400] * 3
    assert answered([0.06, -0.08, 0]) == 200
    assert Project.open(root).settings.light.position == (0.06, -0.08, 0)
    assert answered(None) == 200
    assert Project.open(root).settings.light.position is None


def test_no_line_of_a_linked_text_reaches_the_browser(own, tmp_path):
    """Picks, cameras, settings and mesh that are links out of the project are not quoted."""
    root, page = own
    secret = tmp_path / "secret"
    secret.write_text("root:x:0:0\nhush = 1\n")
    (root / "correspondences" / "0000.csv").symlink_to(secret)
    answers = [page.get("/api/project"), page.post("/api/jobs", json={"kind": "register"})]
    assert answers[0].status_code == 200
    assert answers[1].status_code == 422
    for name in ("cameras.json", "project.toml"):
        (root / name).unlink(missing_ok=True)
        (root / name).symlink_to(secret)
        answers.append(page.get("/api/project"))
        (root / name).unlink()
    (root / "mesh/blocks.ply").unlink()
    (root / "mesh/blocks.obj").symlink_to(secret)
    answers.append(page.get("/api/mesh/full"))

    assert [a.status_code for a in answers[2:]] == [422] * 3
    assert not [a.text for a in answers if "root:" in a.text or "hush" in a.text]


def test_a_linked_photo_that_is_none_shows_nothing(own):
    """Linked photos are allowed (`texproj new` makes them), but only pictures come out."""
    root, page = own
    (root / "photos" / "linked.jpg").symlink_to("/etc/passwd")
    answer = page.get("/api/photos/linked.jpg/image?size=240")

    assert answer.status_code == 422
    assert "root:" not in answer.text


def test_beyond_loopback_a_token_is_needed(root):
    """The token in the address becomes a cookie that other sites cannot use; a wrong one fails."""
    with client(root, host="0.0.0.0", token="right") as page:
        assert page.get("/api/project").status_code == 401
        assert page.get("/?token=wrong").status_code == 401
        first = page.get("/?token=right", follow_redirects=False)

        assert first.status_code == 303
        assert first.headers["location"] == "/"
        assert "HttpOnly" in first.headers["set-cookie"]
        assert "samesite=strict" in first.headers["set-cookie"].lower()
        assert page.get("/api/project").status_code == 200


def test_beyond_loopback_foreign_names_are_still_refused(root):
    """IP addresses are fine there; a name that is not the machine's is a rebinding."""
    with client(root, host="0.0.0.0", token="right") as page:
        page.get("/?token=right")

        assert page.get("/", headers={"host": own_name(page, "192.168.1.5")}).status_code == 200
        assert page.get("/", headers={"host": own_name(page, "evil.example")}).status_code == 403
