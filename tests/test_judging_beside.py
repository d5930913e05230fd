"""What judging and rendering need, made by workers: the same to the last bit as in this process."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from texproj.formats.cameras import read_cameras
from texproj.project import Project
from texproj.resources.workers import WorkerLostError
from texproj.stages.bench import Workbench
from texproj.stages.judging import judgements
from texproj.stages.occlusion_tasks import have_occlusion
from texproj.stages.progress import Cancelled


def quiet() -> None:
    """Nobody asks to stop."""


@dataclass(eq=False)
class Crew:
    """Workers at other workbenches, which are asked in turn. lost: whether they all have ended."""

    benches: list[Workbench]
    lost: bool = False
    done: list[str] = field(default_factory=list)

    @property
    def count(self):
        return len(self.benches)

    def submit(self, work, *args):
        self.done.append(work.__name__)
        return Task(self, self.benches[len(self.done) % self.count], work, args)

    def bring(self, *places):
        assert all(place.exists() for place in places)


@dataclass(eq=False)
class Task:
    crew: Crew
    bench: Workbench
    work: object
    args: tuple

    def result(self, listen):
        listen()
        if self.crew.lost:
            raise WorkerLostError
        return self.work(self.bench, *self.args)


@pytest.fixture
def project(project_folder):
    """Four photos that stand at their true cameras."""
    return Project.open(project_folder)


@pytest.fixture
def bench(project):
    with Workbench(project) as bench:
        yield bench


@pytest.fixture
def crew(project):
    with Workbench(Project.open(project.root)) as one, Workbench(Project.open(project.root)) as two:
        yield Crew([one, two])


@pytest.fixture
def registered(project):
    found = read_cameras(project.root / "truth" / "cameras.json").records
    return {r.file: replace(r, status="registered", method="structure", sought=True) for r in found}


def said(bench, registered, crew):
    """All that is said of each photo, where all are new."""
    found = judgements(bench, registered, set(registered), crew, quiet)
    return {name: vars(one) for name, one in found.items()}


def test_workers_judge_as_this_process_does(bench, crew, registered):
    """From views that whoever came first has made."""
    here, there = said(bench, registered, None), said(bench, registered, crew)

    assert there == here
    assert len(here) == 4 and all(one["proof"]["photos"] for one in here.values())
    assert set(crew.done) == {"_glimpse", "_agreement"}
    assert not (bench.project.work / "views").exists()


def test_whoever_stops_the_work_is_heard_while_photos_are_judged(bench, crew, registered):
    def stop():
        raise Cancelled

    with pytest.raises(Cancelled):
        judgements(bench, registered, set(registered), crew, stop)
    assert not (bench.project.work / "views").exists()


def test_what_workers_did_not_end_is_judged_here(bench, crew, registered, monkeypatch):
    """But not where those of a cluster have ended at it, as this process would."""
    crew.lost = True
    assert said(bench, registered, crew) == said(bench, registered, None)

    monkeypatch.setattr(bench, "crew", crew)
    assert said(bench, registered, crew) == {}


def test_workers_compute_the_ambient_occlusion_that_this_process_does(bench, crew):
    have_occlusion(bench, crew, quiet)
    there = bench.kept_occlusion
    bench.occlusion_path.unlink()

    assert crew.done == ["_block", "_block"]
    assert np.array_equal(there, bench.occlusion)
