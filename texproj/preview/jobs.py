"""Long work: one at a time, with progress for all pages and a way to stop it."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from texproj.errors import TexprojError
from texproj.preview.events import Hub
from texproj.stages.attending import INTERNAL
from texproj.stages.progress import Cancelled, Progress

Work = Callable[[Progress], Any]
State = Literal["waiting", "running", "done", "failed", "cancelled"]

MOST_JOBS = 16
"""Jobs that may wait at a time; a person has no more in mind."""

ETA_FROM_S = 3.0
"""A stage must have worked this long before the time that it still takes is estimated."""

NEWS_INTERVAL_S = 0.1
"""Progress is sent at most this often."""


@dataclass(frozen=True)
class Job:
    """One piece of work as the page sees it.

    title: for people; kind, subject: for the page; stage, done, total, item: how far it is;
    left_s: seconds until the stage is done, None where nothing tells; started: seconds since 1970.
    """

    id: int
    kind: str
    title: str
    subject: str = ""
    state: State = "waiting"
    stage: str = ""
    done: int = 0
    total: int = 0
    item: str = ""
    left_s: float | None = None
    started: float = 0.0
    message: str = ""

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


class Clock:
    """Estimates how long a stage still takes from how long it took so far."""

    def __init__(self) -> None:
        self.now = time.monotonic()
        self._stage = ""
        self._begun = (self.now, 0)

    def left_s(self, stage: str, done: int, total: int) -> float | None:
        """Seconds, if the rest goes as fast as what is done since the stage began; else None."""
        self.now = time.monotonic()
        if stage != self._stage or done < self._begun[1]:
            self._stage, self._begun = stage, (self.now, done)
        took, steps = self.now - self._begun[0], done - self._begun[1]
        if took < ETA_FROM_S or steps <= 0 or done > total:
            return None
        return round(took / steps * (total - done), 1)


class TooManyJobs(TexprojError):  # noqa: N818 - said as what happened
    """More work is asked for than may wait."""


class Jobs:
    """Runs jobs one after the other in a thread of its own (a GL context belongs to one thread)."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._pool = ThreadPoolExecutor(1, "texproj-job")
        self._numbers = itertools.count(1)
        self._stop: dict[int, threading.Event] = {}
        self._jobs: dict[int, Job] = {}
        self._futures: dict[int, Future[Any]] = {}
        self._lock = threading.Lock()

    @property
    def active(self) -> list[Job]:
        """The jobs that wait or run, oldest first."""
        with self._lock:
            return [self._jobs[number] for number in self._stop]

    def start(
        self, kind: str, title: str, work: Work, subject: str = ""
    ) -> tuple[Job, Future[Any]]:
        """Queue `work`, or give back the job of the same kind and subject that waits or runs; a
        sentence that `work` returns is told on the page.

        Raises TooManyJobs.
        """
        with self._lock:
            known = self._same(kind, subject)
            if known is not None:
                return self._jobs[known], self._futures[known]
            if len(self._stop) >= MOST_JOBS:
                raise TooManyJobs(f"{MOST_JOBS} jobs wait already; stop some, or wait for them")
            job = Job(next(self._numbers), kind, title, subject)
            self._stop[job.id] = threading.Event()
            self._jobs[job.id] = job
            self._futures[job.id] = future = self._pool.submit(self._run, job, work)
        self._tell(job)
        return job, future

    def _same(self, kind: str, subject: str) -> int | None:
        """The number of a job of that kind and subject that nobody has stopped."""
        for number, stop in self._stop.items():
            job = self._jobs[number]
            if (job.kind, job.subject) == (kind, subject) and not stop.is_set():
                return number
        return None

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
            self._end(job, "failed", INTERNAL)
            raise
        self._end(job, "done", result if isinstance(result, str) else "")
        return result

    def _listener(self, job: Job) -> Progress:
        """Tells the pages how far the job is, and ends it once somebody asked for that."""
        stop = self._stop[job.id]
        clock = Clock()
        begun = replace(job, state="running", started=time.time())
        last = -NEWS_INTERVAL_S

        def progress(stage: str, done: int, total: int, item: str) -> None:
            nonlocal last
            if stop.is_set():
                raise Cancelled
            left_s = clock.left_s(stage, done, total)
            if clock.now - last > NEWS_INTERVAL_S or done >= total:
                last = clock.now
                far = replace(begun, stage=stage, done=done, total=total, item=item)
                self._tell(replace(far, left_s=left_s))

        progress("", 0, 0, "")
        return progress

    def _end(self, job: Job, state: State, message: str) -> None:
        with self._lock:
            self._stop.pop(job.id, None)
            self._jobs.pop(job.id, None)
            self._futures.pop(job.id, None)
        self._hub.send("job", replace(job, state=state, message=message).as_dict())

    def _tell(self, job: Job) -> None:
        with self._lock:
            if job.id in self._jobs:
                self._jobs[job.id] = job
        self._hub.send("job", job.as_dict())
