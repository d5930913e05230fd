"""Tasks on a Dask cluster of local processes: the same results, whatever becomes of a worker. With
all stages, and one of three workers killed in each, that is tests/bench_cluster.py.
"""

import json
import logging
import os
import shutil
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scale_project import make_picked_project

from texproj.cli import main
from texproj.errors import InputError, RegistrationError, UsageError
from texproj.project import Project
from texproj.resources import cluster as clusters
from texproj.resources.cluster import ClusterError, cluster_at
from texproj.resources.workers import WorkerLostError
from texproj.stages import copies, sites
from texproj.stages.bench import Workbench
from texproj.stages.beside import searched_beside
from texproj.stages.methods import Job, Search, search_as_asked
from texproj.stages.sites import Hands, crew_of
from texproj.version import __version__

PHOTOS = 4


def quiet(*_) -> None:
    """Nobody asks to stop."""


def search_of(job: Job) -> Search:
    return search_as_asked(job, "points")


def dies_once(job: Job, mark: str) -> Search:
    """The first process that comes here ends."""
    try:
        Path(mark).touch(exist_ok=False)
    except FileExistsError:
        return search_of(job)
    os._exit(9)


def fails(job: Job) -> Search:
    raise RegistrationError(f"{job.name}: no", approximate="a start")


def process(_bench) -> int:
    return os.getpid()


@pytest.fixture(scope="module")
def project(tmp_path_factory) -> Project:
    return make_picked_project(tmp_path_factory.mktemp("cluster") / "many", PHOTOS)


@pytest.fixture(scope="module")
def cluster():
    with cluster_at("local:2") as cluster:
        yield cluster


@pytest.fixture
def bench(project, cluster):
    with crew_of(cluster, project) as crew, Workbench(project, crew) as bench:
        yield bench


@pytest.fixture
def jobs(bench):
    return [Job(bench, name, None, {}) for name in bench.project.photo_names]


def same(there: Search, here: Search) -> bool:
    a, b = there.fit, here.fit
    return (
        np.array_equal(a.covariance, b.covariance)
        and np.array_equal(a.camera.pose.R, b.camera.pose.R)
        and np.array_equal(a.camera.pose.t, b.camera.pose.t)
        and a.camera.intrinsics == b.camera.intrinsics
    )


def test_what_workers_find_is_what_this_process_finds(bench, jobs, tmp_path):
    """To the last bit, also where one of two workers ends in the middle of it."""
    search = partial(dies_once, mark=str(tmp_path / "died"))
    with Hands(bench) as hands:
        found = searched_beside(bench, hands, jobs, search, quiet)
        assert all(same(found(job), search_of(job)) for job in jobs)
    assert (tmp_path / "died").exists()


def test_an_error_of_a_search_is_that_of_its_photo(bench, jobs):
    with Hands(bench) as hands:
        found = searched_beside(bench, hands, jobs, fails, quiet)
        with pytest.raises(RegistrationError, match=f"{jobs[0].name}: no") as error:
            found(jobs[0])
        assert error.value.approximate == "a start"


def test_a_photo_at_which_workers_end_is_not_tried_here(bench, jobs, monkeypatch):
    """What has ended several of them would end this process too."""

    def lost(*_):
        raise WorkerLostError

    monkeypatch.setattr(clusters._Task, "result", lost)
    with Hands(bench) as hands:
        found = searched_beside(bench, hands, jobs, fails, quiet)
        with pytest.raises(MemoryError):
            found(jobs[0])


def test_the_work_is_not_done_here(bench):
    pending = [bench.crew.submit(process) for _ in range(6)]

    assert os.getpid() not in {task.result(quiet) for task in pending}


def unseen(_root) -> tuple[str, bool]:
    return __version__, False


def root_of(bench) -> Path:
    return bench.project.root


def mesh_of(bench) -> bytes:
    return bench.project.mesh_path.read_bytes()


def test_a_folder_that_workers_do_not_see_is_copied(cluster, project, monkeypatch, tmp_path):
    """They find the same from the copies, and those that are left go with the run."""
    folder = Path(shutil.copytree(project.root, tmp_path / "there"))
    apart = Project.open(folder)
    monkeypatch.setattr(sites, "_looked_at", unseen)
    monkeypatch.setattr(copies, "BLOCK", 50_000)
    with crew_of(cluster, apart) as crew, Workbench(apart, crew) as bench:
        jobs = [Job(bench, name, None, {}) for name in apart.photo_names]
        here = [search_of(job) for job in jobs]
        there = crew.submit(root_of).result(quiet)
        told = crew.submit(mesh_of).result(quiet)
        with Hands(bench) as hands:
            found = searched_beside(bench, hands, jobs, search_of, quiet)
            for path in (*apart.photo_paths.values(), apart.mesh_path):
                path.unlink()
            assert all(same(found(job), search) for job, search in zip(jobs, here, strict=True))
        assert told == project.mesh_path.read_bytes()

    assert there not in (folder, folder.resolve())
    assert waited_for(lambda: not there.exists())


class Restarting:
    """A cluster of one machine whose worker has another address after each call, and is away or
    lost in between.
    """

    address = "tcp://here:1"

    def __init__(self, there: int) -> None:
        self.calls, self.there = 0, there

    def everywhere(self, work, *args, at=None):
        self.calls += 1
        worker = f"tcp://here:{self.calls}"
        if at is not None and (self.calls < 6 or not self.there):
            raise WorkerLostError
        return {worker: work(*args)} if at or self.there or self.calls == 1 else {}


def unreadable(path):
    raise PermissionError(13, "Permission denied", str(path))


def test_a_file_reaches_whichever_worker_lives(project, tmp_path, monkeypatch):
    monkeypatch.setattr(copies, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(copies, "LISTEN_S", 0.01)
    there = copies.Copies.begun(Restarting(1), project, "run")
    link = project.root / "photos" / "linked.png"
    link.symlink_to(project.mesh_path)
    with monkeypatch.context() as patched:
        patched.setattr(copies, "_blocks", unreadable)
        there.bring(project.mesh_path)
    there.bring(project.mesh_path, link)
    link.unlink()
    same_file = copies.copy_of("run") / project.mesh_path.relative_to(project.root)
    monkeypatch.setattr(copies, "ALONE_S", 0.1)
    gone = copies.Copies.begun(Restarting(0), project, "other")

    assert same_file.read_bytes() == project.mesh_path.read_bytes()
    assert copies.copy_of("run").joinpath("photos/linked.png").is_file()
    with pytest.raises(ClusterError, match="has no worker any more"):
        gone.bring(project.mesh_path)


def waited_for(true) -> bool:
    end = time.monotonic() + 20
    while not true() and time.monotonic() < end:
        time.sleep(0.05)
    return true()


def test_a_photo_outside_the_folder_cannot_be_copied(cluster, project, monkeypatch, tmp_path):
    folder = Path(shutil.copytree(project.root, tmp_path / "there"))
    photos = (folder / "photos").rename(tmp_path / "elsewhere")
    (folder / "project.toml").write_text(f'photos = "{photos}"\n')
    monkeypatch.setattr(sites, "_looked_at", unseen)
    with (
        pytest.raises(InputError, match="lies outside the project folder"),
        crew_of(cluster, Project.open(folder)),
    ):
        pass


def test_another_version_is_told(cluster, project, monkeypatch):
    monkeypatch.setattr(sites, "__version__", "0.0.1")
    with pytest.raises(InputError, match=r"same version"), crew_of(cluster, project):
        pass


def test_the_command_line_takes_a_cluster(project, cluster, monkeypatch, capsys, caplog):
    """By its address: a scheduler that others have started. The log has its dashboard."""
    monkeypatch.setattr(clusters.logging.getLogger("texproj"), "propagate", True)
    address = cluster.client.scheduler_info()["address"]
    with caplog.at_level(logging.INFO, logger="texproj"):
        words = ["--method", "points", "--photos", "*0.png", "--cluster", address]
        code = main(["register", str(project.root), *words])

    assert code == 0 and "2 workers at tcp://" in capsys.readouterr().err
    assert "/status" in caplog.text
    assert len(project.load_cameras()) == 1


def test_colors_are_the_same_to_the_last_byte(project_folder, cluster):
    """Photos projected by workers, one of which meets a photo that cannot be read."""
    told = json.loads((project_folder / "truth" / "cameras.json").read_text())
    for photo in told["photos"]:
        photo |= {"status": "registered", "method": "import"}
    (project_folder / "cameras.json").write_text(json.dumps(told))
    broken = project_folder / "photos" / told["photos"][0]["file"]
    broken.write_bytes(broken.read_bytes()[:-3000])
    written = []
    for address in (cluster.client.scheduler_info()["address"], None):
        where = ["--cluster", address] if address else []
        assert main(["color", str(project_folder), "--to", "vertices", *where]) == 1
        written.append((project_folder / "out" / "model.ply").read_bytes())
        (project_folder / "out" / "model.ply").unlink()
    record = Project.open(project_folder).load_record("color")

    assert written[0] == written[1]
    assert list(record["failed"]) == [broken.name]
    assert not (project_folder / "work" / "points").exists()


@pytest.mark.parametrize(
    "address",
    ["local:0", "local:9999", "local", "host:8786", "tcp://host", "ucx://h:1", "tls://127.0.0.1:1"],
)
def test_an_address_that_is_none_is_told(address):
    with pytest.raises(UsageError, match="give "), cluster_at(address):
        pass


def test_without_dask_the_pip_line_is_told(project, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)

    assert main(["run", str(project.root), "--cluster", "local:2"]) == 2
    assert "pip install distributed bokeh" in capsys.readouterr().err


def test_nobody_answers(monkeypatch):
    monkeypatch.setattr(clusters, "CONNECT_S", 0.2)
    with (
        pytest.raises(ClusterError, match="no Dask scheduler answers"),
        cluster_at("tcp://[::1]:9"),
    ):
        pass


def test_a_scheduler_that_is_lost(bench, jobs, cluster):
    """The last test here: whoever waits is told, and nothing hangs."""
    with Hands(bench) as hands:
        found = searched_beside(bench, hands, jobs, search_of, quiet)
        cluster.client.cluster.sync(cluster.client.cluster.scheduler.close)
        with pytest.raises(ClusterError, match="what was done is kept"):
            for job in jobs:
                found(job)
