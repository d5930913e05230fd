"""Photos searched in processes of their own: the same results, whatever becomes of a process."""

import os
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scale_project import LENS, make_photos

from texproj.errors import RegistrationError
from texproj.stages import beside
from texproj.stages.bench import Workbench
from texproj.stages.beside import FEWEST, searched_beside
from texproj.stages.methods import Job, Search, search_as_asked
from texproj.stages.progress import Cancelled


def search_of(job: Job) -> Search:
    return search_as_asked(job, "points")


def dies(job: Job, test: int) -> Search:
    """Ends any process but that of the test."""
    if os.getpid() != test:
        os._exit(9)
    return Search(None, (f"{job.name} here",))


def fails(job: Job) -> Search:
    raise RegistrationError(f"{job.name}: no")


def sleeps(job: Job, marks: str) -> Search:
    (Path(marks) / str(os.getpid())).touch()
    time.sleep(600)
    return Search()


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("beside") / "many"
    project = make_photos(folder, FEWEST)
    (folder / "correspondences").mkdir()
    for k, name in enumerate(project.photo_names):
        (folder / "correspondences" / name).with_suffix(".csv").write_text(picks(k))
    with Workbench(project) as bench:
        yield bench


def picks(seed: int) -> str:
    """Twelve points in a unit cube four units away, picked a tenth of a pixel off."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-0.5, 0.5, (12, 3))
    uv = LENS.fx * xyz[:, :2] / (xyz[:, 2:] + 4) + (LENS.cx, LENS.cy) + rng.normal(0, 0.1, (12, 2))
    rows = [",".join(map(repr, row.tolist())) for row in np.hstack([uv, xyz])]
    return "\n".join(["u,v,x,y,z", *rows])


@pytest.fixture
def jobs(bench, monkeypatch):
    monkeypatch.setattr(beside, "_workers", lambda faces: 2)
    return [Job(bench, name, None, {}) for name in bench.project.photo_names]


def quiet(name: str) -> None:
    """Nobody asks to stop."""


def test_what_processes_find_is_what_this_one_finds(bench, jobs):
    with searched_beside(bench, jobs, search_of, quiet) as found:
        assert found is not search_of
        for job in jobs:
            there, here = found(job).fit, search_of(job).fit
            assert np.array_equal(there.covariance, here.covariance)
            assert np.array_equal(there.camera.pose.R, here.camera.pose.R)
            assert there.camera.intrinsics == here.camera.intrinsics


def test_an_error_of_a_search_is_that_of_its_photo(bench, jobs):
    with searched_beside(bench, jobs, fails, quiet) as found:
        for job in jobs:
            with pytest.raises(RegistrationError, match=f"{job.name}: no"):
                found(job)


def test_the_photos_of_a_process_that_died_are_searched_here(bench, jobs):
    search = partial(dies, test=os.getpid())
    with searched_beside(bench, jobs, search, quiet) as found:
        assert [found(job).refusals for job in jobs] == [(f"{job.name} here",) for job in jobs]


def test_whoever_stops_the_work_ends_the_processes(bench, jobs, tmp_path):
    def stop(name: str) -> None:
        if any(tmp_path.iterdir()):
            raise Cancelled

    search = partial(sleeps, marks=str(tmp_path))
    began = time.monotonic()
    with pytest.raises(Cancelled), searched_beside(bench, jobs, search, stop) as found:
        found(jobs[0])
    assert time.monotonic() - began < 60
    for mark in tmp_path.iterdir():
        with pytest.raises(ProcessLookupError):
            os.kill(int(mark.name), 0)


def test_few_photos_or_one_processor_need_no_process(bench, jobs, monkeypatch):
    with searched_beside(bench, jobs[: FEWEST - 1], search_of, quiet) as found:
        assert found is search_of
    monkeypatch.setattr(beside, "_workers", lambda faces: 1)
    with searched_beside(bench, jobs, search_of, quiet) as found:
        assert found is search_of


def test_processes_are_as_many_as_memory_holds(monkeypatch):
    monkeypatch.setattr("loky.cpu_count", lambda: 16)
    monkeypatch.setattr("psutil.virtual_memory", lambda: SimpleNamespace(available=4 << 30))
    assert beside._workers(10_000) == 10
    assert beside._workers(5_000_000) == 1
