"""Photos searched in processes of their own: the same results, whatever becomes of a process."""

import os
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scale_project import make_picked_project

from texproj.errors import RegistrationError
from texproj.resources import workers
from texproj.stages import sites
from texproj.stages.bench import Workbench
from texproj.stages.beside import searched_beside
from texproj.stages.methods import Job, Search, search_as_asked
from texproj.stages.progress import Cancelled
from texproj.stages.sites import FEWEST, Hands


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
    project = make_picked_project(tmp_path_factory.mktemp("beside") / "many", FEWEST)
    with Workbench(project) as bench:
        yield bench


@pytest.fixture
def jobs(bench, monkeypatch):
    monkeypatch.setattr(sites, "processes_here", lambda faces: 2)
    return [Job(bench, name, None, {}) for name in bench.project.photo_names]


def quiet(name: str) -> None:
    """Nobody asks to stop."""


def test_what_processes_find_is_what_this_one_finds(bench, jobs):
    with Hands(bench) as hands:
        found = searched_beside(bench, hands, jobs, search_of, quiet)
        assert found is not search_of
        for job in jobs:
            there, here = found(job).fit, search_of(job).fit
            assert np.array_equal(there.covariance, here.covariance)
            assert np.array_equal(there.camera.pose.R, here.camera.pose.R)
            assert there.camera.intrinsics == here.camera.intrinsics


def test_an_error_of_a_search_is_that_of_its_photo(bench, jobs):
    with Hands(bench) as hands:
        found = searched_beside(bench, hands, jobs, fails, quiet)
        for job in jobs:
            with pytest.raises(RegistrationError, match=f"{job.name}: no"):
                found(job)


def test_the_photos_of_a_process_that_died_are_searched_here(bench, jobs):
    search = partial(dies, test=os.getpid())
    with Hands(bench) as hands:
        found = searched_beside(bench, hands, jobs, search, quiet)
        assert [found(job).refusals for job in jobs] == [(f"{job.name} here",) for job in jobs]


def test_whoever_stops_the_work_ends_the_processes(bench, jobs, tmp_path):
    def stop(name: str) -> None:
        if any(tmp_path.iterdir()):
            raise Cancelled

    search = partial(sleeps, marks=str(tmp_path))
    began = time.monotonic()
    with pytest.raises(Cancelled), Hands(bench) as hands:
        searched_beside(bench, hands, jobs, search, stop)(jobs[0])
    assert time.monotonic() - began < 60
    for mark in tmp_path.iterdir():
        with pytest.raises(ProcessLookupError):
            os.kill(int(mark.name), 0)


def test_few_photos_or_one_processor_need_no_process(bench, jobs, monkeypatch):
    with Hands(bench) as hands:
        assert searched_beside(bench, hands, jobs[: FEWEST - 1], search_of, quiet) is search_of
        monkeypatch.setattr(sites, "processes_here", lambda faces: 1)
        assert searched_beside(bench, hands, jobs, search_of, quiet) is search_of


def test_processes_are_as_many_as_memory_holds(monkeypatch):
    monkeypatch.setattr("loky.cpu_count", lambda: 16)
    monkeypatch.setattr("psutil.virtual_memory", lambda: SimpleNamespace(available=4 << 30))
    assert workers.processes_here(10_000) == 10
    assert workers.processes_here(5_000_000) == 1
