"""Whatever a project's files hold: the outcome or one sentence, never a traceback."""

import io
import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from texproj.cli import main
from texproj.project import Project

FILES = (
    "project.toml", "cameras.json", "mesh/scan.ply", "photos/b.png", "masks/b.png",
    "correspondences/a.csv", "work/color.json", "work/hashes.json", "work/register/a.png.json",
    "out/model.ply",
)  # fmt: skip
WRONG_RECORD = '{"inputs": 5, "a.png": 1, "outputs": [1], "after": 3, "format": 1}'
TOML = '[color]\nto = "vertices"\n'


def refuse_to_open(path: Path, monkeypatch) -> None:
    """As a file without permission to read: the superuser, who may run tests, reads everything."""

    def guarded(file, *args, **kwargs):
        if str(file) == str(path):
            raise PermissionError(13, "Permission denied", str(path))
        return real(file, *args, **kwargs)

    real = io.open
    monkeypatch.setattr("io.open", guarded)
    monkeypatch.setattr("builtins.open", guarded)


def as_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


SPOIL = {
    "garbage": lambda path: path.write_bytes(bytes(range(256)) * 4),
    "empty": lambda path: path.write_bytes(b""),
    "folder": as_folder,
    "json": lambda path: path.write_text(WRONG_RECORD),
}


def ascii_ply(vertices, faces) -> str:
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty double x\n"
        f"property double y\nproperty double z\nelement face {len(faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    rows = [" ".join(map(repr, map(float, v))) for v in vertices]
    return head + "\n".join([*rows, *(" ".join(map(str, (3, *f))) for f in faces)]) + "\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A ball in three tiny pictures, one with picks and two with cameras, run once."""
    root = tmp_path_factory.mktemp("abuse") / "ball"
    for folder in ("mesh", "photos", "masks", "correspondences"):
        (root / folder).mkdir(parents=True)
    ball = trimesh.creation.icosphere(2)
    ball.export(root / "mesh/scan.ply")
    rng = np.random.default_rng(0)
    for name in "abc":
        picture = cv2.resize(rng.integers(0, 255, (12, 16, 3)).astype(np.uint8), (64, 48))
        cv2.imwrite(str(root / f"photos/{name}.png"), picture)
        cv2.imwrite(str(root / f"masks/{name}.png"), np.full((48, 64), 255, np.uint8))
    given = [camera_entry("b.png", 0.05), camera_entry("c.png", 0.1)]
    (root / "cameras.json").write_text(cameras_text(given))
    front = ball.vertices[ball.vertices[:, 2] < -0.3][::8]
    uv = front[:, :2] / (front[:, 2:] + 4) * 80 + (32, 24)
    rows = [",".join(map(str, row)) for row in np.hstack([uv, front])]
    (root / "correspondences/a.csv").write_text("\n".join(["u,v,x,y,z", *rows]))
    (root / "project.toml").write_text(TOML)
    assert main(["run", str(root)]) == 0
    return root


def camera_entry(name: str, x: float) -> dict:
    return {
        "file": name, "width": 64, "height": 48, "K": [[80, 0, 32], [0, 80, 24], [0, 0, 1]],
        "dist": [0, 0, 0, 0, 0], "R": np.eye(3).tolist(), "t": [x, 0, 4], "status": "registered",
        "quality": {"expected_error_px": 0.5, "picks": []}, "note": 1,
    }  # fmt: skip


def cameras_text(entries: list) -> str:
    return json.dumps({"format": "texproj-cameras", "version": 1, "photos": entries})


@pytest.fixture
def folder(made, tmp_path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "ball"))


def outcome(capsys, *words) -> tuple[int, str]:
    """The exit code and what was complained: one sentence, none where all is done."""
    capsys.readouterr()
    code = main([str(word) for word in words])
    text = capsys.readouterr().err
    assert "Traceback" not in text
    assert text.count("texproj:") == (0 if code == 0 else 1), text
    return code, text


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("kind", SPOIL)
@pytest.mark.parametrize("file", FILES)
def test_a_file_that_holds_something_else(folder, capsys, file, kind):
    """Garbage, nothing, a folder, or other JSON in place of any file."""
    SPOIL[kind](folder / file)

    for command in ("status", "run"):
        code, _ = outcome(capsys, command, folder)
        assert code in (0, 1, 2)
        if file in ("project.toml", "cameras.json", "mesh/scan.ply") and command == "run":
            assert code == 2 or (file, kind) == ("project.toml", "empty")


@pytest.mark.parametrize("file", FILES)
def test_a_file_that_may_not_be_read(folder, capsys, monkeypatch, file):
    """Without permission: named if it is needed."""
    refuse_to_open(folder / file, monkeypatch)

    for command in ("status", "run"):
        code, text = outcome(capsys, command, folder)
        assert code in (0, 1, 2)
        if file in ("project.toml", "cameras.json"):
            assert code == 2 and file in text


TRIANGLE = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
NAN = float("nan")


@pytest.mark.parametrize(
    ("vertices", "faces", "code"),
    [
        ([*TRIANGLE, (NAN, 0, 0)], [(0, 1, 2), (1, 2, 3)], 2),
        ([*TRIANGLE, (float("inf"), 0, 0)], [(0, 1, 2), (1, 2, 3)], 2),
        ([(NAN, NAN, NAN)] * 3, [(0, 1, 2)], 2),
        (TRIANGLE, [], 2),
        ([(0, 0, 0)], [(0, 0, 0)], 2),
        (TRIANGLE, [(0, 1, 7), (0, 1, -2)], 2),
        ([(x + 1000, y, z) for x, y, z in TRIANGLE], [(0, 1, 2)], 2),
    ],
)
def test_a_mesh_with_something_wrong(folder, capsys, vertices, faces, code):
    """Not a number, infinite, no faces, one vertex, corners that are not there, out of sight."""
    (folder / "mesh/scan.ply").write_text(ascii_ply(vertices, faces))
    (folder / "photos/a.png").unlink()
    given = [camera_entry("b.png", 0.05), camera_entry("c.png", 0.1)]
    (folder / "cameras.json").write_text(cameras_text(given))

    assert outcome(capsys, "run", folder)[0] == code


VALUES = (
    None, 5, -1, "x", "", [], {}, True, [[1]], [None] * 3, 1e300, float("inf"), NAN, 10**5000,
)  # fmt: skip


def as_json(value) -> str:
    return "9" * 5000 if value == 10**5000 else json.dumps(value)


@pytest.mark.parametrize("value", VALUES, ids=lambda v: as_json(v)[:9])
def test_a_camera_entry_with_a_wrong_type(folder, capsys, value):
    """Every key of an entry, and of its quality, with a value that does not belong there."""
    keys = [*camera_entry("b.png", 0), "method", "start", "before_refine"]
    texts = []
    for key in keys:
        entry = {**camera_entry("b.png", 0), key: "VALUE"}
        texts.append(cameras_text([entry]).replace('"VALUE"', as_json(value)))
    for key in ("expected_error_px", "picks", "reason", "through"):
        entry = {**camera_entry("b.png", 0), "quality": {key: "VALUE"}}
        texts.append(cameras_text([entry]).replace('"VALUE"', as_json(value)))
    for text in texts:
        (folder / "cameras.json").write_text(text)
        for words in (["status"], ["export", "--format", "colmap"]):
            assert outcome(capsys, words[0], folder, *words[1:])[0] in (0, 2), text


@pytest.mark.parametrize("twice", ["masks/b.png", "correspondences/a.csv"])
def test_two_files_for_one_photo_stop_no_other(folder, capsys, twice):
    """Its two masks or picks are told where that photo is used; all else goes on, `status` too."""
    other = folder / twice.replace("a.csv", "a.png.csv").replace("b.png", "b.png.png")
    other.write_bytes((folder / twice).read_bytes())
    photo = "a.png" if "csv" in twice else "b.png"
    project = Project.open(folder)

    assert main(["status", str(folder)]) == 0
    code, complaint = outcome(capsys, "run", folder)
    failed = {**project.load_record("color")["failed"]}
    records = project.load_cameras()
    failed |= {n: r.quality["reason"] for n, r in records.items() if r.status == "failed"}
    assert code == 1 and "of 3 photos" in complaint
    assert list(failed) == [photo] and f"both belong to {photo}; keep one" in failed[photo]
    assert main(["report", str(folder)]) == 0


@pytest.mark.parametrize(
    "text",
    [
        "a=" + "[" * 5000, "[unwrap]\npage_size=" + "9" * 5000, "[color]\nto=2020-01-01",
        'mesh="a\\u0000b"', 'photos="/nonexistent"', "[color]\nto=['texture']", "color=[1]",
    ],
    ids=range(7),
)  # fmt: skip
def test_settings_that_cannot_be(folder, capsys, text):
    """One sentence that names project.toml or what it points to."""
    (folder / "project.toml").write_text(text)

    assert outcome(capsys, "status", folder)[0] == 2


def test_settings_saved_with_a_byte_order_mark(folder, capsys):
    """As some editors write UTF-8."""
    (folder / "project.toml").write_text("\ufeff" + TOML, encoding="utf-8")

    assert outcome(capsys, "status", folder)[0] == 0


@pytest.mark.parametrize(
    "rows",
    ['1,2,3,4,5,"a\n2,3,4,5,6,b', "1,2,3,4,5," + "x" * 200_000, "1,2,\0,4,5", "1e300,2,3,4,5"],
)
def test_picks_that_cannot_be_read_fail_their_photo_alone(folder, capsys, rows):
    """An open quote, an endless field, a zero byte, a pixel out of this world."""
    (folder / "correspondences/a.csv").write_text(f"u,v,x,y,z,name\n{rows}\n")

    assert outcome(capsys, "register", folder)[0] == 1


# --- places that cannot be written


@pytest.mark.parametrize(
    ("place", "command"), [("work", "register"), ("work", "run"), ("out", "run")]
)
def test_nothing_is_changed_where_results_cannot_be_kept(folder, capsys, place, command):
    """A file in the way of a folder: cameras.json is as it was, byte for byte."""
    (folder / "correspondences/a.csv").write_text(
        (folder / "correspondences/a.csv").read_text() + "\n"
    )
    shutil.rmtree(folder / place)
    (folder / place).write_text("in the way")
    before = (folder / "cameras.json").read_bytes()
    code, text = outcome(capsys, command, folder)

    assert code == 2 and f"{place}: there is a file of that name" in text
    assert (folder / "cameras.json").read_bytes() == before
    assert (folder / place).read_text() == "in the way"


@pytest.mark.parametrize("full", ["work/register", "."])
def test_a_disk_that_fills_up_keeps_camera_and_record_together(folder, capsys, monkeypatch, full):
    """No space for the record, or for cameras.json: both are the old ones."""
    picks = folder / "correspondences/a.csv"
    picks.write_text(picks.read_text() + "\n")
    files = (folder / "cameras.json", folder / "work/register/a.png.json")
    before = [path.read_bytes() for path in files]
    real = Path.open

    def guarded(path, mode="r", *args, **kwargs):
        if "w" in mode and path.parent.parent == folder / full:
            raise OSError(28, "No space left on device", str(path))
        return real(path, mode, *args, **kwargs)

    monkeypatch.setattr(Path, "open", guarded)

    assert outcome(capsys, "register", folder)[0] == 2
    assert [path.read_bytes() for path in files] == before
    assert Project.open(folder).load_cameras()
    assert not list(folder.rglob(".unfinished-*"))
