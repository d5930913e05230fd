"""Many photos: what is done and what is kept grows with the photos, not with their square.

Operations are counted, not seconds: calls of functions, Python's and others'.
"""

import sys
from collections import Counter
from collections.abc import Callable
from contextlib import contextmanager

import numpy as np
import pytest
from scale_project import LENS, chain, make_block_project, make_photos, make_scale_project

from texproj.camera import Pose
from texproj.intake import find_masks, one_per_shot
from texproj.project import Project
from texproj.records import THROUGH, CameraRecord
from texproj.register.proof.agreement import Agreement
from texproj.register.proof.camps import rulings
from texproj.stages import attempts, keeping, registering
from texproj.stages.bench import Workbench
from texproj.stages.neighborhood import Behind, Neighborhood
from texproj.stages.partners import ALIKE, FOLDER, content_key
from texproj.stages.registering import register_photos
from texproj.stages.status import project_status
from texproj.stages.surroundings import Surroundings

FEW, MANY = 50, 200
MOST = 1.2
"""How many times as much a photo may cost among many as among few."""


@contextmanager
def counted():
    """Counts calls while the block runs."""
    count = Counter()

    def see(_frame, event, _arg):
        count[event] += event in ("call", "c_call")

    sys.setprofile(see)
    try:
        yield count
    finally:
        sys.setprofile(None)


def growth(cost: Callable[[int], float]) -> float:
    """How many times as much each of many costs as each of few."""
    return (cost(MANY) / MANY) / (cost(FEW) / FEW)


@pytest.mark.parametrize("make", [make_scale_project, make_block_project])
def test_status_of_many_photos(make, tmp_path):
    def cost(photos: int) -> int:
        make(tmp_path / str(photos), photos)
        project_status(Project.open(tmp_path / str(photos)))  # loads programs
        with counted() as calls:
            project_status(Project.open(tmp_path / str(photos)))
        return calls.total()

    assert 0.5 < growth(cost) < MOST


def test_what_is_kept_of_a_block(tmp_path):
    """All photos placed together: their list is there once."""

    def cost(photos: int) -> int:
        project = make_block_project(tmp_path / str(photos), photos)
        return sum(path.stat().st_size for path in project.work.rglob("*.json"))

    assert 0.5 < growth(cost) < MOST


def test_photos_found_one_through_the_other(tmp_path, monkeypatch):
    """The whole of `register`, its searches left out."""

    chain(monkeypatch, "IMG_00000.png")
    monkeypatch.setattr(registering, "compare_looks", by_name)
    monkeypatch.setattr(attempts, "judged", lambda *_: {})
    monkeypatch.setattr(attempts, "told_rests_on", lambda *_: "")
    monkeypatch.setattr(keeping, "SHARE", 1e-9)  # as seldom as can be: that depends on time

    def cost(photos: int) -> int:
        project = make_photos(tmp_path / str(photos), photos)
        with Workbench(project) as bench, counted() as calls:
            outcomes = register_photos(bench)
        assert not any(outcome.failed for outcome in outcomes)
        return calls.total()

    assert 0.5 < growth(cost) < MOST


def by_name(bench, _progress) -> None:
    """The photos next to one by name are those that look like it."""
    project, names = bench.project, bench.project.photo_names
    alike = {n: [*names[k + 1 : k + 4], *names[max(k - 3, 0) : k]] for k, n in enumerate(names)}
    keys = {name: content_key(project, name) for name in names}
    project.save_record(FOLDER, ALIKE, {"inputs": keys, "alike": alike})


def test_masks_of_no_photo_and_shots_in_two_files(tmp_path):
    def cost(photos: int) -> int:
        folder = tmp_path / str(photos)
        folder.mkdir()
        names = [f"IMG_{k:05d}" for k in range(photos)]
        for name in names:
            (folder / f"mask {name}.png").touch()
        both = {
            f"{name}.{end}": folder / f"{name}.{end}" for name in names for end in ("jpg", "nef")
        }
        with counted() as calls:
            found = find_masks(folder, names)
            kept = one_per_shot(both, (".nef",), "raw")
        assert len(found.notes) == photos and len(kept.paths) == photos
        return calls.total() - 4 * photos * found.notes[0].count("mean")  # five are looked up

    assert 0.5 < growth(cost) < MOST


def test_rulings_over_many_photos():
    """Each contradicts two others: a camp of its own."""

    def cost(photos: int) -> int:
        bad, good = Agreement(40, 0, 0.05), Agreement(40, 30, 0.05)
        pairs = {(k, k + j): bad if j < 3 else good for k in range(photos - 4) for j in (1, 2, 4)}
        with counted() as calls:
            told = rulings(photos, pairs, ())
        assert len(told) == photos
        return calls.total()

    assert 0.5 < growth(cost) < MOST


def test_whom_a_found_photo_stirs(tmp_path):
    """Whenever the photos around one become others, it is among those that are said to be stirred;
    and they are few.
    """
    rng = np.random.default_rng(0)
    names = [f"{k:03d}" for k in range(120)]
    known = {n: [names[k] for k in rng.choice(120, 5, replace=False)] for n in names[3:]}
    waiting = set(names)
    entries = {n: entry(n, names, rng) for n in names if rng.random() < 0.3}
    registered = {n for n in entries if rng.random() < 0.9}
    near = Neighborhood(names, registered, known)
    surroundings = Surroundings(near, Behind(entries.values()), waiting)
    stirred_in_all = 0
    for name in rng.permutation(names):
        before = {n: surroundings.around(n) for n in names}
        waiting.discard(name)
        surroundings.settle(entry(name, sorted(registered - waiting), rng))
        stirred = surroundings.take_stirred()
        changed = {n for n in names if {*surroundings.around(n)} - {*before[n]} and n in waiting}

        assert changed <= stirred
        stirred_in_all += len(stirred)
    assert stirred_in_all < 0.5 * len(names) ** 2


def entry(name: str, others: list[str], rng: np.random.Generator) -> CameraRecord:
    """Registered or failed, found through two others or through none."""
    through = (
        [n for n in rng.choice(others, 2) if n != name] if others and rng.random() < 0.5 else []
    )
    status = "registered" if rng.random() < 0.8 else "failed"
    quality = {THROUGH: through} if through and status == "registered" else {}
    pose = Pose.identity() if status == "registered" else None
    return CameraRecord(name, 60, 40, LENS, pose, status, "features", quality, sought=True)
