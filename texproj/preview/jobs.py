"""Long work: one at a time, with progress for all pages and a way to stop it."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from texproj.errors import TexprojError
from texproj.preview.events import Hub
from texproj.stages.progress import Cancelled, Progress

Work = Callable[[Progress], Any]
State = Literal["waiting", "running", "done", "failed", "cancelled"]

LOG = logging.getLogger(__name__)

NEWS_INTERVAL_S = 0.1
"""Progress is sent at most this often."""


@dataclass(frozen=True)
class Job:
    """One piece of work as the page sees it. title: for people; kind, subject: for the page."""

    id: int
    kind: str
    title: str
    subject: str = ""
    state: State = "waiting"
    done: int = 0
    total: int = 0
    item: str = ""
    message: str = ""

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


class Jobs:
    """Runs jobs one after the other in a thread of its own (a GL context belongs to one thread)."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._pool = ThreadPoolExecutor(1, "texproj-job")
        self._numbers = itertools.count(1)
        self._stop: dict[int, threading.Event] = {}
        self._jobs: dict[int, Job] = {}
        self._lock = threading.Lock()

    @property
    def active(self) -> list[Job]:
        """The jobs that wait or run, oldest first."""
        with self._lock:
            return [self._jobs[number] for number in self._stop]

    def start(
        self, kind: str, title: str, work: Work, subject: str = ""
    ) -> tuple[Job, Future[Any]]:
        """Queue `work`; the same kind and subject is not queued twice at a time."""
        job = Job(next(self._numbers), kind, title, subject)
        with self._lock:
            self._stop[job.id] = threading.Event()
            self._jobs[job.id] = job
        self._tell(job)
        return job, self._pool.submit(self._run, job, work)

    def cancel(self, number: int) -> bool:
        """Ask a job to stop; False if there is no such job any more."""
        with self._lock:
            event = self._stop.get(number)
        if event is not None:
            event.set()
        return event is not None

    def close(self) -> None:
        """Stop everything."""
        with self._lock:
            for event in self._stop.values():
                event.set()
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _run(self, job: Job, work: Work) -> Any:
        try:
            result = work(self._listener(job))
        except Cancelled:
            self._end(job, "cancelled", "Stopped; what was finished before is kept.")
            raise
        except TexprojError as error:
            self._end(job, "failed", str(error))
            raise
        except BaseException:
            LOG.exception("%s failed", job.title)
            self._end(job, "failed", "An unexpected error; the terminal shows it.")
            raise
        self._end(job, "done", "")
        return result

    def _listener(self, job: Job) -> Progress:
        stop = self._stop[job.id]
        last = 0.0

        def progress(stage: str, done: int, total: int, item: str) -> None:
            nonlocal last
            if stop.is_set():
                raise Cancelled
            now = time.monotonic()
            if now - last > NEWS_INTERVAL_S or done >= total:
                last = now
                told = f"{stage} {item}".strip()
                self._tell(replace(job, state="running", done=done, total=total, item=told))

        progress("", 0, 0, "")
        return progress

    def _end(self, job: Job, state: State, message: str) -> None:
        with self._lock:
            self._stop.pop(job.id, None)
            self._jobs.pop(job.id, None)
        self._hub.send("job", replace(job, state=state, message=message).as_dict())

    def _tell(self, job: Job) -> None:
        with self._lock:
            if job.id in self._jobs:
                self._jobs[job.id] = job
        self._hub.send("job", job.as_dict())
