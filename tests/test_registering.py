"""Registration from end to end on tiny pictures: what is redone, in which order, and what one
photo's fault does to the others.
"""

import json
import logging
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from scale_project import LENS, chain, make_photos, make_scale_project

from texproj.camera import Camera, Pose
from texproj.cli import main
from texproj.project import Project
from texproj.records import CameraRecord, Fit
from texproj.stages import attempts, keeping, methods, registering
from texproj.stages.bench import Workbench
from texproj.stages.lineage import registration_freshness
from texproj.stages.methods import Search, believed
from texproj.stages.registering import register_photos
from texproj.stages.wave import Wave

PICKED = ("a.png", "b.png", "c.png")
TOML = '[color]\nto = "vertices"\n[refine]\nenabled = false\n'


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A ball in three small pictures with picks, and a file that is no picture, run once."""
    root = tmp_path_factory.mktemp("registering") / "ball"
    for part in ("mesh", "photos", "correspondences"):
        (root / part).mkdir(parents=True)
    ball = trimesh.creation.icosphere(2)
    ball.export(root / "mesh/scan.ply")
    rng = np.random.default_rng(0)
    (root / "photos/d.png").write_bytes(b"no picture")
    for k, name in enumerate(PICKED):
        picture = cv2.resize(rng.integers(0, 255, (12, 16, 3)).astype(np.uint8), (320, 240))
        cv2.imwrite(str(root / "photos" / name), picture)
        picks(root, name, ball, 0.1 * k)
    (root / "project.toml").write_text(TOML)
    assert main(["run", str(root)]) == 1
    return root


def picks(root: Path, name: str, ball: trimesh.Trimesh, x: float) -> None:
    """Picks of the true projection, with noise of a tenth of a pixel."""
    front = ball.vertices[ball.vertices[:, 2] < -0.3][::3]
    rng = np.random.default_rng(len(name) + int(10 * x))
    uv = (front[:, :2] + (x, 0)) / (front[:, 2:] + 4) * 400 + (160, 120)
    rows = np.hstack([uv + rng.normal(0, 0.1, uv.shape), front])
    text = "\n".join(["u,v,x,y,z", *(",".join(map(str, row)) for row in rows)])
    (root / "correspondences" / name).with_suffix(".csv").write_text(text)


@pytest.fixture
def folder(made, tmp_path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "ball"))


def command(capsys, *words) -> tuple[int, dict]:
    capsys.readouterr()
    code = main([*map(str, words), "--json"])
    return code, json.loads(capsys.readouterr().out)


def stale(folder: Path, capsys) -> dict[str, str]:
    items = command(capsys, "status", folder)[1]["items"]
    return {s["item"]: s["reason"] for s in items if not s["fresh"] and not s["failed"]}


def cameras(folder: Path) -> dict[str, dict]:
    entries = json.loads((folder / "cameras.json").read_text())["photos"]
    return {entry["file"]: entry for entry in entries}


def by_themselves(entries: dict[str, dict]) -> dict[str, dict]:
    """The entries without what the other photos say of them."""
    said = ("proofs", "reason")
    return {
        name: {**entry, "quality": {k: v for k, v in entry["quality"].items() if k not in said}}
        for name, entry in entries.items()
    }


# --- what is redone


def test_a_solve_from_picks_makes_nothing_stale(folder, capsys):
    """What `--method points` and the page's Solve do is what the next `run` would have done."""
    before = cameras(folder)
    picked = folder / "correspondences/a.csv"
    picked.write_text(picked.read_text() + "\n")
    code, told = command(capsys, "register", folder, "--method", "points", "--photos", "a.png")

    assert code == 0 and [p["kept"] for p in told["photos"]] == [False]
    assert set(stale(folder, capsys)) <= {"report.html"}  # which shows the picks
    assert all(p["kept"] for p in command(capsys, "run", folder)[1]["photos"])
    assert cameras(folder) == before


def test_a_registration_depends_on_the_settings_that_its_method_read(folder, capsys):
    """Picks need no [structure]; [points] they do."""
    (folder / "project.toml").write_text(f"{TOML}[structure]\nmax_error_percent = 0.4\n")
    assert stale(folder, capsys) == {}

    (folder / "project.toml").write_text(f"{TOML}[points]\nmax_error_percent = 0.4\n")
    changed = stale(folder, capsys)
    assert {name: changed[name] for name in PICKED} == dict.fromkeys(
        PICKED, "[points] settings changed"
    )


def test_another_method_that_is_asked_for_is_tried(folder, capsys):
    """A failure by one method alone is no reason for `run` to try no other."""
    for name in ("b.png", "c.png"):
        main(["register", str(folder), "--method", "mutual-information", "--photos", name])
        assert cameras(folder)[name]["status"] == "failed"

    assert stale(folder, capsys)["b.png"] == "only mutual-information was tried"
    assert command(capsys, "register", folder)[1]["photos"][1]["status"] == "registered"


def test_status_does_not_call_a_failure_fresh(folder, capsys):
    """It failed, and nothing has changed since then; it is done again when something has."""
    assert main(["status", str(folder)]) == 0
    line = next(x for x in capsys.readouterr().out.splitlines() if "d.png" in x)
    item = next(i for i in command(capsys, "status", folder)[1]["items"] if i["item"] == "d.png")

    assert line.endswith("failed, inputs unchanged") and "fresh" not in line
    assert not item["fresh"] and item["failed"] and item["reason"] == "failed, inputs unchanged"
    (folder / "photos/d.png").write_bytes((folder / "photos/a.png").read_bytes())
    assert stale(folder, capsys)["d.png"] == "photo changed"


def test_a_run_without_anything_to_do_writes_nothing(folder, monkeypatch):
    """Neither model nor report, nor is anything rendered; a report that is gone is made again."""

    def refused(*_):
        raise AssertionError("something is rendered")

    def state() -> dict[str, tuple[int, int]]:
        files = [path for path in folder.rglob("*") if path.is_file() and "log" not in path.parts]
        kept = [path for path in files if path.name not in ("hashes.json", "lock")]
        return {str(path): (path.stat().st_mtime_ns, path.stat().st_ino) for path in kept}

    before = state()
    monkeypatch.setattr("texproj.render.open_renderer", refused)
    assert main(["run", str(folder)]) == 1
    assert state() == before

    monkeypatch.undo()
    (folder / "out/report.html").unlink()
    main(["run", str(folder)])
    assert (folder / "out/report.html").is_file()


def test_a_photo_that_is_excluded_takes_part_in_nothing(folder, capsys):
    """Its camera stays in the file; a name that is no photo is refused, with the nearest one."""
    (folder / "project.toml").write_text(f'exclude = ["b.png", "d.png"]\n{TOML}')
    code, told = command(capsys, "run", folder)
    assert code == 0 and [p["file"] for p in told["photos"]] == ["a.png", "c.png"]
    assert told["color"]["used"] == ["a.png", "c.png"] and told["color"]["failed"] == {}
    assert cameras(folder)["b.png"]["status"] == "registered"

    (folder / "project.toml").write_text(f'exclude = ["bb.png"]\n{TOML}')
    assert main(["status", str(folder)]) == 2
    assert "bb.png" in (error := capsys.readouterr().err) and "did you mean 'b.png'" in error
    (folder / "project.toml").write_text(f'exclude = "b.png"\n{TOML}')
    assert main(["status", str(folder)]) == 2
    assert "must be a list" in capsys.readouterr().err


# --- one photo's fault


NUMERICS = (np.linalg.LinAlgError("Eigenvalues did not converge"), "internal fault, please report")


@pytest.mark.parametrize(
    ("name", "fault", "words"),
    [
        ("a.png", *NUMERICS),
        ("b.png", MemoryError(), "not enough memory"),
        ("c.png", ValueError("nobody foresaw this"), "work/log/texproj.log"),
    ],
    ids=["numerics", "memory", "other"],
)
def test_what_nobody_foresaw_in_one_photo_is_its_failure_alone(
    folder, capsys, monkeypatch, caplog, name, fault, words
):
    """All others end as without it; the log has the traceback; the next run tries it again."""
    expected = cameras(folder)
    shutil.rmtree(folder / "work")
    (folder / "cameras.json").unlink()
    solve, photo = methods.METHODS["points"], name
    monkeypatch.setattr(
        methods, "_by_points", lambda job: _fails(fault) if job.name == photo else solve(job)
    )
    with caplog.at_level(logging.ERROR, "texproj"):
        assert main(["register", str(folder)]) == 1
    found = cameras(folder)

    assert "Traceback" not in capsys.readouterr().err
    assert words in found[name]["quality"]["reason"] and found[name]["status"] == "failed"
    others = [n for n in PICKED if n != name]
    alone, before = by_themselves(found), by_themselves(expected)
    assert {n: alone[n] for n in others} == {n: before[n] for n in others}
    record = next(r for r in caplog.records if name in r.getMessage())
    assert record.exc_info is not None and record.exc_info[1] is fault
    monkeypatch.undo()
    main(["register", str(folder)])
    assert cameras(folder)[name] == expected[name]


def _fails(error: Exception):
    raise error


def test_a_fit_that_does_not_tell_its_error_is_not_believed():
    """Without a covariance there is no expected error; NaN is not smaller than any limit."""
    camera = Camera(LENS, Pose.identity())
    for error in (np.inf, np.nan):
        fit = Fit(camera, "points", error, np.zeros(0), np.zeros(0, bool), np.zeros((6, 6)))
        assert not believed(fit).accepted and "cannot be told" in believed(fit).reason
    sure = replace(fit, expected_error_px=1.0)
    assert believed(sure) is sure


# --- through others


def test_who_had_a_start_is_not_told_that_there_was_none():
    """What was tried says why it failed; the rest of the methods had nothing to try."""
    nothing = Search().reason

    assert nothing.startswith("nothing to start from")
    assert Search(None, ("too far off", nothing)).reason == "too far off"


def test_the_wave_goes_on_until_nothing_changes(tmp_path, monkeypatch):
    """Photos against the order of their names, each found through the one after it: all in one
    run, none tried again before those that have more to go by; a second run has nothing to do.
    """
    project = make_photos(tmp_path / "chain", 30)
    names = project.photo_names
    calls = chain(monkeypatch, first=names[-1])
    with Workbench(project) as bench:
        first = register_photos(bench)
        again = register_photos(bench)

    assert all(not outcome.failed and not outcome.kept for outcome in first)
    assert all(outcome.kept for outcome in again)
    assert calls.total() <= 2 * len(names)
    assert all(state.fresh for state in registration_freshness(Project.open(project.root)))


def test_what_never_is_found_is_tried_again_only_with_new_evidence(tmp_path, monkeypatch):
    """A gap that nothing bridges: photos beyond it fail, once a run, and stay settled."""
    project = make_photos(tmp_path / "gap", 24)
    names = project.photo_names
    calls = chain(monkeypatch, first=names[0])
    (project.photo_path(names[12])).write_bytes(b"no photo")
    real = registering.search_by_others

    def broken(job, *rest):
        job.project.photo_info(job.name)  # what is no photo cannot be read
        return real(job, *rest)

    monkeypatch.setattr(registering, "search_by_others", broken)
    with Workbench(project) as bench:
        first = {o.name: o for o in register_photos(bench)}
        tried = calls.total()
        again = register_photos(bench)

    assert [n for n in names if first[n].failed] == names[12:]
    assert tried <= 3 * len(names) and calls.total() == tried
    assert all(outcome.kept for outcome in again)
    assert not any(
        state.fresh or not state.failed
        for state in registration_freshness(Project.open(project.root))[12:]
    )


def test_the_photo_with_most_evidence_comes_first():
    """Untried before tried, ready before waiting, more shared points before fewer; and a photo
    that failed comes again only with evidence that it has not failed with.
    """
    evidence = {name: frozenset({("x", "1")}) for name in "abcd"}
    strength = dict(zip("abcd", (5, 9, 7, 100), strict=True))
    wave = Wave(evidence.__getitem__, strength.__getitem__, lambda name: name == "d")
    for name in "abcd":
        wave.add(name)
    wave.look("abcd")
    order = [wave.next() for _ in range(4)]

    assert order == ["b", "c", "a", "d"] and wave.next() is None
    evidence["a"] |= {("b", "1")}
    wave.drop("b")
    wave.look("ab")
    assert wave.next() == "a" and wave.next() is None and wave.left == ["a", "c", "d"]


def test_photos_placed_together_depend_on_each_other(tmp_path, monkeypatch):
    """Method "block": another picture in place of one makes all of them stale."""
    project = make_photos(tmp_path / "block", 4)

    def place(_bench, names, _anchors, _progress):
        camera = Camera(LENS, Pose(np.eye(3), np.array([0, 0, 4.0])))
        ok = np.ones(4, bool)
        return {n: Fit(camera, "block", 1.0, np.ones(4), ok, np.eye(6)) for n in names}

    monkeypatch.setattr(attempts, "as_block", place)
    with Workbench(project) as bench:
        outcomes = register_photos(bench)
    assert {o.record.method for o in outcomes} == {"block"}
    assert all(state.fresh for state in registration_freshness(Project.open(project.root)))

    path = project.photo_path(project.photo_names[2])
    path.write_bytes(path.read_bytes() + b"\0")
    states = registration_freshness(Project.open(project.root))
    assert all("photos of the block changed" in state.reason for state in states)


def placing(monkeypatch, found) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
    """Stands in for the block: `found(names, anchors)`; returns what it was asked, call by call."""
    asked = []

    def place(_bench, names, anchors, _progress):
        asked.append((tuple(names), tuple(anchors)))
        return found(names, anchors)

    monkeypatch.setattr(attempts, "as_block", place)
    return asked


def placed_at(z: float, reason: str = "") -> Fit:
    camera = Camera(LENS, Pose(np.eye(3), np.array([0, 0, z])))
    return Fit(camera, "block", 1.0, np.ones(4), np.ones(4, bool), np.eye(6), reason=reason)


@pytest.fixture
def imported(tmp_path) -> Project:
    """Five photos, of which another program has registered one, wrongly."""
    project = make_photos(tmp_path / "imported", 5)
    camera = Camera(LENS, Pose(np.eye(3), np.array([0, 0, 9.0])))
    name = project.photo_names[2]
    size = camera.width, camera.height
    record = CameraRecord(name, *size, LENS, camera.pose, "registered", "import")
    project.save_cameras([record])
    return Project.open(project.root)


def test_what_the_others_do_not_bear_out_is_placed_with_them(imported, monkeypatch):
    """Few registered photos are asked about by all others before any is sought through them; a
    wrong one is moved, keeps its camera as a start, and nothing is stale then.
    """
    names = imported.photo_names
    asked = placing(monkeypatch, lambda _, anchors: {
        n: placed_at(4.0, "not borne out" if n in anchors else "") for n in names
    })  # fmt: skip
    with Workbench(imported) as bench:
        outcomes = {o.name: o for o in register_photos(bench)}
    moved = imported.load_cameras()[names[2]]

    assert asked == [((*names[:2], *names[3:]), (names[2],))]
    assert outcomes[names[2]].reason == "not borne out"
    assert moved.method == "block" and moved.pose.t[2] == 4
    assert moved.start.status == "prior" and moved.start.pose.t[2] == 9
    assert all(state.fresh for state in registration_freshness(Project.open(imported.root)))


def test_a_doubted_photo_vouches_for_no_other(imported, monkeypatch):
    """Nothing bears it out and the block is refused: it stays, with the reason, and no photo is
    sought through it, now or in the next run.
    """
    names = imported.photo_names
    asked = placing(monkeypatch, lambda _, anchors: {
        n: "nobody bears it out" if n in anchors else f"{names[2]} is doubted" for n in names
    })  # fmt: skip
    sought = []

    def by_others(job, _earlier, _before=None):
        sought.append(tuple(job.neighbors))
        return Search(None, ("nothing is shared",), ("features",))

    monkeypatch.setattr(registering, "search_by_others", by_others)
    with Workbench(imported) as bench:
        outcomes = {o.name: o for o in register_photos(bench)}
    doubted = imported.load_cameras()[names[2]]

    assert doubted.status == "registered" and not doubted.vouches
    assert outcomes[names[2]].reason == "nobody bears it out"
    assert all(outcomes[n].failed for n in names if n != names[2])
    assert set(sought) == {()}
    with Workbench(Project.open(imported.root)) as bench:
        assert all(outcome.kept for outcome in register_photos(bench))
    assert len(asked) == 1


def test_many_registered_photos_are_believed(imported, monkeypatch):
    """The block is not asked where most photos are registered: a wrong one is outvoted."""
    first, *rest = imported.load_cameras().values()
    imported.save_cameras([replace(first, file=name) for name in imported.photo_names[:3]])
    asked = placing(monkeypatch, lambda *_: {})
    by_others = Search(None, ("nothing is shared",), ("features",))
    monkeypatch.setattr(registering, "search_by_others", lambda *_: by_others)
    project = Project.open(imported.root)
    with Workbench(project) as bench:
        register_photos(bench)

    assert rest == [] and [len(names) for names, _ in asked] == [2]  # at last, once all failed


def test_a_block_can_be_asked_for(imported, monkeypatch, capsys):
    """`--method block` places the chosen photos together; of too few it says so."""
    names = imported.photo_names
    asked = placing(
        monkeypatch, lambda names, _: {n: placed_at(4.0) for n in names if len(names) > 2}
    )
    chosen = ("--photos", "IMG_0000[0-2]*")
    code, told = command(capsys, "register", imported.root, "--method", "block", *chosen)
    assert code == 0 and asked[0][0] == tuple(names[:3])
    assert {p["method"] for p in told["photos"]} == {"block"}

    few = ("--photos", names[3])
    code, told = command(capsys, "register", imported.root, "--method", "block", *few)
    assert code == 1 and "three photos or more" in told["photos"][0]["reason"]


# --- what it costs, and what is kept


def calls_of(work) -> int:
    """How many functions of Python are called: grows as time does, but is the same each time."""
    count = 0

    def profiler(_frame, event, _arg):
        nonlocal count
        count += event == "call"

    sys.setprofile(profiler)
    try:
        work()
    finally:
        sys.setprofile(None)
    return count


def test_status_costs_twice_as_much_for_twice_as_many_photos(tmp_path):
    """Half of them failed, a quarter found through others; all are what they are said to be."""
    cost = {}
    for count in (10, 40, 80, 160):  # the first loads modules
        project = make_scale_project(tmp_path / str(count), count)
        states = registration_freshness(Project.open(project.root))
        assert [state.failed for state in states] == [False, True] * (count // 2)
        assert all(state.fresh for state in states[::2])
        cost[count] = calls_of(lambda: registration_freshness(Project.open(project.root)))  # noqa: B023

    assert cost[160] - cost[80] < 2.2 * (cost[80] - cost[40])


def test_registration_costs_twice_as_much_for_twice_as_many_photos(tmp_path, monkeypatch):
    """Also what is written: cameras.json is not written anew for each photo."""
    monkeypatch.setattr(keeping, "SHARE", 1e-9)
    monkeypatch.setattr(attempts, "as_block", lambda *_: {})
    cost, writes = {}, {}
    for count in (10, 40, 80, 160):  # the first loads modules
        project = make_photos(tmp_path / str(count), count)
        saved = []
        save = Project.save_cameras

        def noted(self, records, save=save, saved=saved):
            saved.append(1)
            save(self, records)

        monkeypatch.setattr(Project, "save_cameras", noted)
        with Workbench(project) as bench:
            cost[count] = calls_of(lambda: register_photos(bench))
        monkeypatch.setattr(Project, "save_cameras", save)
        writes[count] = len(saved)
        assert all(e.status == "failed" for e in project.load_cameras().values())

    assert set(writes.values()) == {2}
    assert cost[160] - cost[80] < 2.2 * (cost[80] - cost[40])


def test_what_is_done_is_kept_when_the_work_is_interrupted(folder, monkeypatch):
    """Ctrl-C at the third photo, though nothing was to be written before the end."""
    monkeypatch.setattr(keeping, "SHARE", 1e-9)
    expected = cameras(folder)
    shutil.rmtree(folder / "work")
    (folder / "cameras.json").unlink()

    def listener(_stage, _done, _total, name):
        if name == "c.png":
            raise KeyboardInterrupt

    with Workbench(Project.open(folder)) as bench, pytest.raises(KeyboardInterrupt):
        register_photos(bench, progress=listener)
    kept = by_themselves(cameras(folder))

    assert kept == {name: by_themselves(expected)[name] for name in ("a.png", "b.png")}
    states = registration_freshness(Project.open(folder))
    assert [state.fresh for state in states] == [True, True, False, False]


def test_a_photo_that_cannot_be_read_is_named_once(made):
    """Whoever tells the reason names the photo before it."""
    reason = Project.open(made).load_cameras()["d.png"].quality["reason"]

    assert reason.startswith("not a photo"), reason
