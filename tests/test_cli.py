"""The command line: what a user types, what comes back, and what happens to bad input."""

import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import pytest

from texproj.cli import main
from texproj.project import Project


def run(*words) -> int:
    return main([str(word) for word in words])


def complaint(capsys) -> str:
    """The one sentence on standard error."""
    text = capsys.readouterr().err.strip()
    assert "Traceback" not in text
    return text


def only_points(folder: Path) -> None:
    """Leave the photos that have picks, so that a test needs no rendering."""
    names = {path.stem for path in (folder / "correspondences").glob("*.csv")}
    for photo in (folder / "photos").iterdir():
        if photo.stem not in names:
            photo.unlink()
    (folder / "cameras.json").unlink(missing_ok=True)


@pytest.fixture(scope="module")
def made(demo_folder, tmp_path_factory):
    """Two photos with picks, registered and colored."""
    folder = Path(shutil.copytree(demo_folder, tmp_path_factory.mktemp("cli") / "stele"))
    only_points(folder)
    assert run("run", folder, "--color.to", "vertices") == 0
    return folder


@pytest.fixture
def colored(made, tmp_path):
    return Path(shutil.copytree(made, tmp_path / "stele"))


@pytest.fixture
def registered(colored):
    """The same before it is colored."""
    shutil.rmtree(colored / "out")
    return colored


# --- the path that everybody takes


def test_run_colors_a_project_and_a_second_run_does_nothing(project_folder, capsys):
    """Register, color and report; then everything is fresh and the files stay as they are."""
    only_points(project_folder)

    assert run("run", project_folder, "--color.to", "vertices", "--json") == 0
    first = json.loads(capsys.readouterr().out)
    out = project_folder / "out"
    before = {p.name: p.stat().st_mtime_ns for p in out.iterdir() if p.name.startswith("model")}
    assert run("run", project_folder, "--color.to", "vertices", "--json") == 0
    second = json.loads(capsys.readouterr().out)
    after = {p.name: p.stat().st_mtime_ns for p in out.iterdir() if p.name.startswith("model")}

    assert [p["status"] for p in first["photos"]] == ["registered"] * 2
    assert not any(p["kept"] for p in first["photos"]) and not first["color"]["kept"]
    assert all(p["kept"] for p in second["photos"]) and second["color"]["kept"]
    assert before == after and "model.ply" in before


def test_touching_one_photo_redoes_that_photo(registered, capsys):
    """A changed mask makes its own photo stale and no other, and status says why."""
    masked = Project.open(registered).photo_names[0]
    (registered / "masks").mkdir(exist_ok=True)
    shutil.copy(registered / "truth" / "masks" / f"{Path(masked).stem}.png", registered / "masks")
    capsys.readouterr()
    run("status", registered, "--json")
    states = json.loads(capsys.readouterr().out)["items"]
    stale = {s["item"]: s["reason"] for s in states if s["stage"] == "register" and not s["fresh"]}
    run("register", registered, "--json")
    photos = json.loads(capsys.readouterr().out)["photos"]

    assert stale == {masked: "mask changed"}
    assert [p["file"] for p in photos if not p["kept"]] == [masked]


def test_what_was_given_is_not_lost_when_a_photo_fails(project_folder, capsys):
    """A start camera stays in cameras.json when the photo cannot be registered from it."""
    project = Project.open(project_folder)
    name = next(n for n in project.photo_names if not project.correspondences_path(n).is_file())
    (project_folder / "photos" / name).write_bytes(b"no photo")
    start = project.load_cameras()[name]

    assert run("register", project_folder, "--photos", name) == 1
    entry = Project.open(project_folder).load_cameras()[name]

    assert entry.status == "failed" and entry.pose is None
    assert list(entry.start.pose.t) == pytest.approx(list(start.pose.t))
    assert name in complaint(capsys) or name in entry.quality["reason"]


def test_new_makes_a_project(demo_folder, tmp_path, capsys):
    """Mesh and photos are in their places and the settings can be read."""
    mesh, photos = demo_folder / "mesh" / "scan.ply", demo_folder / "photos"

    assert run("new", tmp_path / "p", "--mesh", mesh, "--photos", photos, "--json") == 0
    told = json.loads(capsys.readouterr().out)

    project = Project.open(tmp_path / "p")
    assert told["photos"] == project.photo_names == sorted(p.name for p in photos.iterdir())
    assert project.mesh_path.read_bytes() == mesh.read_bytes()


def test_new_refuses_a_folder_with_something_in_it(demo_folder, tmp_path, capsys):
    """Nothing is overwritten."""
    (tmp_path / "thesis.txt").write_text("years of work")
    mesh = demo_folder / "mesh" / "scan.ply"

    assert run("new", tmp_path, "--mesh", mesh, "--photos", demo_folder / "photos") == 2
    assert "exists and is not empty" in complaint(capsys)


def test_new_refuses_photos_that_differ_only_in_their_ending(demo_folder, tmp_path, capsys):
    """Masks and picks are found by the name without it: said before anything is made."""
    photo = next((demo_folder / "photos").iterdir())
    for name in ("a.jpg", "a.png"):
        shutil.copy(photo, tmp_path / name)
    made, mesh = tmp_path / "p", demo_folder / "mesh" / "scan.ply"

    assert run("new", made, "--mesh", mesh, "--photos", tmp_path / "a.jpg", tmp_path / "a.png") == 2
    assert "a.jpg and a.png differ only" in complaint(capsys)
    assert not made.exists()


def test_new_on_a_full_disk_leaves_nothing_behind(demo_folder, tmp_path, capsys, monkeypatch):
    """The third file does not fit: what was copied before it is taken away again."""
    copied: list[str] = []

    def copy(source, target):
        if len(copied) == 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        copied.append(target.write_bytes(source.read_bytes()))

    monkeypatch.setattr("texproj.files.shutil.copyfile", copy)
    mesh, photos = demo_folder / "mesh" / "scan.ply", demo_folder / "photos"

    assert run("new", tmp_path / "p", "--mesh", mesh, "--photos", photos) == 2
    assert "disk is full" in complaint(capsys)
    assert len(copied) == 2 and not list(tmp_path.iterdir())


def test_doctor_tells_of_the_renderers(capsys):
    """The ray caster works wherever texproj is installed."""
    assert run("doctor", "--json") == 0
    findings = {f["name"]: f for f in json.loads(capsys.readouterr().out)["findings"]}

    assert findings["renderer cpu"]["good"]


def test_a_package_that_is_missing_is_named(project_folder, monkeypatch, capsys):
    """No traceback: a sentence that says how to get it, and why it may be missing."""
    monkeypatch.setitem(sys.modules, "xatlas", None)
    monkeypatch.setattr("texproj.cli.telling.open_project", lambda *_: import_module("xatlas"))

    assert run("status", project_folder) == 2
    assert "the package xatlas is not installed" in complaint(capsys)


# --- usage


def test_an_unknown_command_names_the_nearest(capsys):
    """So does the shell of every well-kept tool."""
    assert run("registr", "x") == 2
    assert 'Did you mean "register"' in complaint(capsys)


def test_an_unknown_option_is_an_error(project_folder, capsys):
    """Nothing is ignored in silence."""
    assert run("color", project_folder, "--to-texture") == 2
    assert "--to-texture" in complaint(capsys)


def test_an_option_out_of_bounds_names_the_bound(project_folder, capsys):
    """A texture page of no size."""
    assert run("color", project_folder, "--unwrap.page-size", "0") == 2
    assert "page_size = 0" in complaint(capsys)


def test_a_flag_overrides_project_toml_which_overrides_the_default(project_folder):
    """Each default lives once."""
    from texproj.cli.flags import apply_flags
    from texproj.settings import read_settings

    settings = read_settings('[color]\nto = "vertices"', "x")

    assert read_settings("", "x").color.to == "texture"
    assert apply_flags(settings, None).color.to == "vertices"


def test_no_two_flags_of_a_command_collide():
    """Options of several sections meet on one command line."""
    from texproj.cli.commands import app

    for name in app:
        if not name.startswith("-"):
            assert app[name].assemble_argument_collection() is not None


# --- bad input: one sentence, exit code 2 or 1, nothing half-written


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (shutil.rmtree, "no project folder"),
        (lambda f: shutil.rmtree(f / "mesh"), "no mesh in"),
        (lambda f: shutil.copy(f / "mesh/scan.ply", f / "mesh/two.ply"), "several meshes"),
        (lambda f: (f / "mesh/scan.ply").write_bytes(b""), "scan.ply"),
        (lambda f: [p.unlink() for p in (f / "photos").iterdir()], "no photos in"),
        (lambda f: (f / "project.toml").write_text("color = {tu = 1}"), "unknown key 'tu'"),
        (lambda f: (f / "cameras.json").write_text("{"), "cameras.json"),
    ],
)
def test_unusable_input_is_refused_in_one_sentence(project_folder, capsys, spoil, words):
    """Exit code 2, the reason, and no output folder."""
    spoil(project_folder)

    assert run("run", project_folder) == 2
    text = complaint(capsys)
    assert words in text and text.count("texproj:") == 1
    assert not (project_folder / "out").exists()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"u,v,x,y\n1,2,3,4\n", "z"),
        (b"u,v,x,y,z\n1,2,3,4,high\n", "high"),
        (b"u,v,x,y,z\n1,2,3,4,5\n2,2,3,4,5\n3,2,3,4,6\n", "4"),
        (b"u,v,x,y,z\n" + b"".join(b"%d,99999,%d,0,1\n" % (i, i) for i in range(6)), "outside"),
    ],
)
def test_one_photo_with_bad_picks_stops_no_other(project_folder, capsys, content, words):
    """Exit code 1; the photo is named with the reason, the others are registered."""
    only_points(project_folder)
    good, bad = sorted((project_folder / "correspondences").glob("*.csv"))
    bad.write_bytes(content)

    assert run("register", project_folder, "--json") == 1
    photos = {p["file"]: p for p in json.loads(capsys.readouterr().out)["photos"]}

    assert words in photos[f"{bad.stem}.jpg"]["reason"]
    assert photos[f"{good.stem}.jpg"]["status"] == "registered"


@pytest.mark.parametrize("content", [b"", b"a text file, not a photo\n", None])
def test_one_broken_photo_stops_no_other(project_folder, capsys, content):
    """Zero bytes, text, or cut off in the middle: the model is made from the rest."""
    only_points(project_folder)
    path = sorted((project_folder / "photos").iterdir())[-1]
    path.write_bytes(path.read_bytes()[:9000] if content is None else content)

    assert run("run", project_folder, "--color.to", "vertices") == 1
    captured = capsys.readouterr()
    assert path.name in captured.out and "Traceback" not in captured.err
    assert (project_folder / "out" / "model.ply").is_file()


def test_a_camera_of_no_photo_is_named(registered, capsys):
    """The nearest photo's name helps against typing errors; the rest is colored."""
    path = registered / "cameras.json"
    data = json.loads(path.read_text())
    stray = data["photos"][0]["file"].replace("IMG_", "IMG")
    data["photos"].append({**data["photos"][0], "file": stray})
    path.write_text(json.dumps(data))
    capsys.readouterr()

    assert run("color", registered, "--to", "vertices") == 1
    out = capsys.readouterr().out
    assert stray in out and "did you mean" in out
    assert (registered / "out" / "model.ply").is_file()


def test_nothing_registered_is_said(project_folder, capsys):
    """Color alone needs cameras."""
    (project_folder / "cameras.json").unlink()

    assert run("color", project_folder) == 2
    assert "texproj register" in complaint(capsys)


def test_a_read_only_out_folder_is_said(registered, capsys):
    """Whoever runs it: a file stands where the folder should be."""
    (registered / "out").write_text("in the way")

    assert run("color", registered, "--to", "vertices") == 2
    assert "out" in complaint(capsys)
    assert (registered / "out").read_text() == "in the way"


def test_a_full_disk_keeps_the_old_model(colored, capsys, monkeypatch):
    """The model that was there before is intact, byte for byte."""
    old = (colored / "out" / "model.ply").read_bytes()
    (colored / "masks").mkdir(exist_ok=True)
    name = Project.open(colored).photo_names[0]
    shutil.copy(colored / "truth" / "masks" / f"{Path(name).stem}.png", colored / "masks")

    def full(folder, *_):
        (folder / "model.ply").write_bytes(old[:100])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("texproj.stages.writing.write_vertices", full)
    capsys.readouterr()

    assert run("color", colored, "--to", "vertices") == 2
    assert "disk is full" in complaint(capsys)
    assert (colored / "out" / "model.ply").read_bytes() == old
    assert not list((colored / "out").glob(".unfinished-*"))


def test_ctrl_c_in_the_middle_and_the_next_run_resumes(project_folder):
    """A real interrupt of a real process; what was registered before it is kept."""
    only_points(project_folder)
    # a test run in the background of a shell has interrupts switched off
    start = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler);"
        "from texproj.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    words = [sys.executable, "-c", start, "run", str(project_folder), "--color.to", "vertices"]
    process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    records = project_folder / "work" / "register"
    deadline = time.monotonic() + 60
    while not (records.is_dir() and any(records.glob("*.json"))) and time.monotonic() < deadline:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    done = {path.name: path.read_bytes() for path in records.glob("*.json")}

    assert process.returncode == 130 and "Traceback" not in err, err
    assert done
    assert main(["run", str(project_folder), "--color.to", "vertices"]) == 0
    assert {name: (records / name).read_bytes() for name in done} == done


# --- help


def test_every_command_has_help_with_an_example(capsys):
    """`--help` of each command ends well and shows how it is used."""
    from make_reference import command_names

    for name in command_names():
        assert run(name, "--help") == 0
        assert f"texproj {name}" in re.sub(r"\s+", " ", capsys.readouterr().out)


def test_the_list_of_commands_says_what_each_does(capsys):
    """The commands are loaded when they are called, but the list needs their sentences."""
    assert run("--help") == 0
    listed = re.sub(r"[\s│]+", " ", capsys.readouterr().out)

    assert "report Write out/report.html and out/report.json." in listed
    assert "new Make a project folder of a mesh and photos." in listed
