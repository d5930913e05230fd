"""Tasks on a cluster: processes of other machines, lent by a Dask scheduler, or of this one.

Dask gives the tasks of a worker that ends to another. What a worker opens (a mesh, a renderer)
lasts from task to task; OpenGL wants it used by one thread, so each process runs one task at once.
"""

from __future__ import annotations

import logging
import re
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from typing import Any, Generic, TypeVar
from urllib.parse import urlsplit

from texproj.errors import TexprojError, UsageError
from texproj.resources.workers import LISTEN_S, THREADS, Pending, WorkerLostError

T = TypeVar("T")
LOG = logging.getLogger("texproj")

MOST_LOCAL = 256
CONNECT_S, CLOSE_S = 10, 2
"""Seconds to find a scheduler: it is there or it is not; to take leave of one that may be gone."""
ALONE_S = 180
"""Seconds without any worker after which nobody will come: one that died is back before, on a busy
machine, too."""
TRIES = 3
"""To reach all workers, of which one may end just then."""
SILENT = "60 s"
"""After which a worker of this machine that gives no sign of life is taken for dead: reading the
largest mesh keeps one silent for half of that."""
QUIET = re.compile(r"(distributed|bokeh|tornado)\b")
"""Loggers of others; each has a level and a way to the terminal of its own."""
BACK_AGAIN = "600 s"
"""In which a process of this machine that ended is begun anew: after that Dask gives it up. Its own
15 seconds are too few on a busy machine."""
MISSING = "--cluster needs Dask, which is not installed: pip install distributed bokeh"


class ClusterError(TexprojError):
    """A cluster that cannot be reached or is gone."""


@dataclass(frozen=True, eq=False)
class Cluster:
    """The workers of a Dask cluster. address: as it was asked for; dashboard: a link to what it is
    doing; client: Dask's; hosts: the machines that tasks are for, none for all.
    """

    address: str
    dashboard: str
    client: Any
    hosts: frozenset[str] = frozenset()
    _alone_since: list[float] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Workers that are there now."""
        there = self.client.scheduler_info(n_workers=-1)["workers"]
        return sum(not self.hosts or host_of(worker) in self.hosts for worker in there)

    def on(self, workers: Iterable[str]) -> Cluster:
        """The same, tasks for the machines of these workers alone: those that come later have not
        been looked at.
        """
        return replace(self, hosts=frozenset(map(host_of, workers)))

    def submit(self, work: Callable[..., T], *args: Any) -> Pending[T]:
        """Have ``work(*args)`` run by whoever is free."""

        def begin() -> Any:
            where = sorted(self.hosts) or None
            return self.client.submit(_in_one_thread, work, *args, pure=False, workers=where)

        return _Task(self, begin, [begin()])

    def everywhere(
        self, work: Callable[..., T], *args: Any, at: Sequence[str] | None = None
    ) -> dict[str, T]:
        """What ``work(*args)``, which must be quick, gives in each worker, by its address. at: of
        these workers alone. Raises ClusterError, WorkerLostError where one ends meanwhile time and
        again.
        """
        for _ in range(TRIES):
            try:
                found: dict[str, T] = self.client.run(work, *args, workers=at and [*at])
            except (OSError, CancelledError) as error:
                if self.client.status != "running":
                    raise self.gone() from error
            else:
                return found
        raise WorkerLostError

    def after_tasks(self, work: Callable[[], None]) -> None:
        """Have each worker call ``work()`` after the task that it is at."""
        if self.client.status == "running":
            self.client.run(_after_tasks, work, on_error="ignore")

    def check(self) -> None:
        """Raise ClusterError where the scheduler is gone, or has had no worker for long."""
        if self.client.status != "running":
            raise self.gone()
        if self.count:
            self.somebody_is_there()
            return
        self._alone_since[:] = self._alone_since or [time.monotonic()]
        if time.monotonic() - self._alone_since[0] > ALONE_S:
            raise ClusterError(
                f"the cluster at {self.address} has no worker left; what was done is kept: start"
                " workers, then the same command again"
            )

    def somebody_is_there(self) -> None:
        """There is a worker, or was one a moment ago."""
        self._alone_since.clear()

    def gone(self) -> ClusterError:
        """That the scheduler does not answer any more."""
        return ClusterError(
            f"the Dask scheduler of {self.address} is gone; what was done is kept: start it again,"
            " then the same command, or leave out --cluster"
        )


@dataclass(frozen=True, eq=False)
class _Task(Generic[T]):
    """begin: have it run once more; futures: Dask's, of each time."""

    cluster: Cluster
    begin: Callable[[], Any]
    futures: list[Any]

    def result(self, listen: Callable[[], None]) -> T:
        from distributed import KilledWorker  # noqa: PLC0415 - slow to load

        try:
            return self._awaited(listen)
        except KilledWorker:  # maybe for another task that the worker had
            self.futures.append(self.begin())
        try:
            return self._awaited(listen)
        except KilledWorker as error:
            raise WorkerLostError from error

    def _awaited(self, listen: Callable[[], None]) -> T:
        future, done = self.futures[-1], threading.Event()
        future.add_done_callback(lambda _: done.set())
        listen()
        while not future.done():
            done.wait(LISTEN_S)
            self.cluster.check()
            listen()
        self.cluster.somebody_is_there()
        try:
            found: T = future.result()
        except CancelledError as error:
            raise self.cluster.gone() from error
        return found


def host_of(worker: str) -> str:
    """The machine in a worker's address, ``tcp://host:port``."""
    return urlsplit(worker).hostname or worker


@contextmanager
def cluster_at(address: str) -> Iterator[Cluster]:
    """The cluster at ``tcp://host:port`` or ``tls://...``, or so many processes here for
    ``local:4``, within this block. Raises UsageError for another address or without Dask,
    ClusterError for one that does not answer.
    """
    local = re.fullmatch(r"local:(\d+)", address)
    if local is None and not re.fullmatch(r"(tcp|tls)://\S+:\d+", address):
        raise UsageError(f"--cluster {address!r}: give tcp://HOST:8786, or local:4")
    if local is not None and not 1 <= int(local[1]) <= MOST_LOCAL:
        raise UsageError(f"--cluster {address!r}: give 1 to {MOST_LOCAL} processes")
    try:
        import distributed  # noqa: PLC0415 - slow to load, and an extra
    except ImportError:
        raise UsageError(MISSING) from None
    for name in filter(QUIET.match, [*logging.root.manager.loggerDict]):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # we say what matters ourselves
    with _cluster_here(int(local[1])) if local else nullcontext() as here:
        try:
            client = distributed.Client(here or address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ClusterError(f"no Dask scheduler answers at {address}: {_short(error)}") from None
        except TypeError:  # Dask's, where it has no certificates
            raise UsageError(
                f"--cluster {address!r}: Dask has no certificates; name them in its"
                " configuration (distributed.comm.tls), or give tcp://HOST:8786"
            ) from None
        try:
            cluster = Cluster(address, client.dashboard_link, client)
            _await_workers(cluster)
            LOG.info("cluster %s: %d workers, %s", address, cluster.count, cluster.dashboard)
            yield cluster
        finally:
            with suppress(Exception):  # it may be gone already; nothing is lost with it
                client.close(timeout=CLOSE_S)


@contextmanager
def _cluster_here(count: int) -> Iterator[Any]:
    """A scheduler and so many workers of one thread each, which end with this block."""
    import dask  # noqa: PLC0415 - slow to load, and an extra
    from distributed import LocalCluster  # noqa: PLC0415

    env = {**dict.fromkeys(THREADS, "1"), "LP_NUM_THREADS": "0"}
    patient = {
        "scheduler.worker-ttl": SILENT,
        "deploy.lost-worker-timeout": BACK_AGAIN,
        "scheduler.worker-saturation": 1.0,  # whoever waits behind a task is not blamed with it
    }
    with dask.config.set({f"distributed.{key}": value for key, value in patient.items()}):
        here = LocalCluster(
            n_workers=count, threads_per_worker=1, dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL, env=env,
        )  # fmt: skip
        try:
            yield here
        finally:
            with suppress(Exception):
                here.close(timeout=CLOSE_S)


def _await_workers(cluster: Cluster) -> None:
    try:
        cluster.client.wait_for_workers(1, timeout=CONNECT_S)
    except TimeoutError:
        raise ClusterError(
            f"the Dask scheduler at {cluster.address} has no worker; start some:"
            f" dask worker {cluster.address} --nthreads 1"
        ) from None


def _short(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__


# --- in a worker

_THREAD: list[ThreadPoolExecutor] = []
"""The thread of this process in which all tasks run."""


def _after_tasks(work: Callable[[], None]) -> None:
    if _THREAD:
        _THREAD[0].submit(work)


def _in_one_thread(work: Callable[..., T], *args: Any) -> T:
    if not _THREAD:
        _THREAD.append(ThreadPoolExecutor(1))
    return _THREAD[0].submit(work, *args).result()
