"""Tasks on workers, event by event: who does what when, what waits for disk and network, who dies.

Machines have processors, which their workers share evenly where there are more of them. Shared
storage, and the process that leads, do one thing after the other. Times are seconds.
"""

from __future__ import annotations

import heapq
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

NOTHING_S = 1e-9


@dataclass(frozen=True)
class Task:
    """cpu_s: of one processor; read, returned: bytes from shared storage, and to who leads; lead_s:
    what who leads has to do for it.
    """

    cpu_s: float
    read: float = 0.0
    returned: float = 0.0
    lead_s: float = 0.0


@dataclass(frozen=True)
class Farm:
    """What there is. start_s: processor time until a worker has programs and mesh; storage,
    network: bytes per second, of all together; slow_share, slow_factor: how many tasks take how
    many times as long; hours_to_failure: of one worker, which is back after `back_s`.
    """

    machines: int = 1
    workers_each: int = 1
    processors_each: float = 1.0
    start_s: float = 2.0
    storage: float = 1e9
    network: float = 1e9
    slow_share: float = 0.0
    slow_factor: float = 5.0
    hours_to_failure: float = math.inf
    back_s: float = 30.0

    @property
    def workers(self) -> int:
        return self.machines * self.workers_each


@dataclass(frozen=True)
class Outcome:
    """seconds: on the clock; lost: tasks that died with their worker; storage, lead: part of the
    time in which each was at work.
    """

    seconds: float
    lost: int
    storage: float
    lead: float


class _Line:
    """Something that serves one after the other."""

    def __init__(self) -> None:
        self.free = self.busy = 0.0

    def serve(self, now: float, length: float) -> float:
        """When that is done."""
        self.free, self.busy = max(self.free, now) + length, self.busy + length
        return self.free


class _Worker:
    """computing: whether it takes part in the machine's processors; version: another one for each
    thing that it does.
    """

    def __init__(self, machine: _Machine) -> None:
        self.machine, self.task, self.left_s = machine, None, 0.0
        self.computing, self.version, self.idle = False, 0, False

    def begin(self, task: Task | None, left_s: float, computing: bool) -> None:
        self.task, self.left_s, self.computing, self.idle = task, left_s, computing, False
        self.version += 1


class _Machine:
    def __init__(self, farm: Farm) -> None:
        self.processors, self.at, self.version = farm.processors_each, 0.0, 0
        self.workers = [_Worker(self) for _ in range(farm.workers_each)]

    @property
    def computing(self) -> list[_Worker]:
        return [worker for worker in self.workers if worker.computing]

    def rate(self) -> float:
        return min(1.0, self.processors / max(len(self.computing), 1))

    def go_on(self, now: float) -> None:
        """What was computed up to now."""
        done = (now - self.at) * self.rate()
        for worker in self.computing:
            worker.left_s -= done
        self.at = now


class Stage:
    """Independent tasks; whoever is free takes the next."""

    def __init__(self, farm: Farm, tasks: Sequence[Task], seed: int, started: bool) -> None:
        self.farm, self.rng = farm, np.random.default_rng(seed)
        slow = self.rng.random(len(tasks)) < farm.slow_share
        factor = np.where(slow, farm.slow_factor, 1.0)
        self.waiting = deque(
            replace(task, cpu_s=task.cpu_s * f) for task, f in zip(tasks, factor, strict=True)
        )
        self.left, self.lost, self.now = len(tasks), 0, 0.0
        self.storage, self.lead = _Line(), _Line()
        self.events: list[tuple[float, int, str, object]] = []
        self.numbers = count()
        self.machines = [_Machine(farm) for _ in range(farm.machines)]
        for machine in self.machines:
            for worker in machine.workers:
                worker.begin(None, NOTHING_S if started else farm.start_s, True)
                self._plan_failure(worker)
            self._plan(machine)

    def run(self) -> Outcome:
        """Until the last result is there."""
        while self.left:
            self.now, _, what, who = heapq.heappop(self.events)
            getattr(self, f"_{what}")(who)
        length = max(self.now, NOTHING_S)
        return Outcome(self.now, self.lost, self.storage.busy / length, self.lead.busy / length)

    def _push(self, when: float, what: str, who: object) -> None:
        heapq.heappush(self.events, (when, next(self.numbers), what, who))

    def _plan(self, machine: _Machine) -> None:
        machine.version += 1
        if computing := machine.computing:
            soonest = max(min(worker.left_s for worker in computing), 0.0) / machine.rate()
            self._push(self.now + soonest, "computed", (machine, machine.version))

    def _plan_failure(self, worker: _Worker) -> None:
        if math.isfinite(self.farm.hours_to_failure):
            seconds = 3600 * self.rng.exponential(self.farm.hours_to_failure)
            self._push(self.now + seconds, "died", worker)

    def _take(self, worker: _Worker) -> None:
        """The next task, which is read first."""
        worker.begin(None, 0.0, False)
        if not self.waiting:
            worker.idle = True
            return
        worker.task = task = self.waiting.popleft()
        at = self.storage.serve(self.now, task.read / self.farm.storage)
        self._push(at, "was_read", (worker, worker.version))

    # --- what happens

    def _computed(self, who: tuple[_Machine, int]) -> None:
        machine, version = who
        if version != machine.version:
            return
        machine.go_on(self.now)
        for worker in machine.computing:
            if worker.left_s <= NOTHING_S:
                if (task := worker.task) is not None:
                    length = task.returned / self.farm.network + task.lead_s
                    self._push(self.lead.serve(self.now, length), "was_told", None)
                self._take(worker)
        self._plan(machine)

    def _was_read(self, who: tuple[_Worker, int]) -> None:
        worker, version = who
        if version == worker.version:
            worker.machine.go_on(self.now)
            worker.begin(worker.task, worker.task.cpu_s, True)
            self._plan(worker.machine)

    def _was_told(self, _: None) -> None:
        self.left -= 1

    def _died(self, worker: _Worker) -> None:
        worker.machine.go_on(self.now)
        if worker.task is not None:
            self.waiting.append(worker.task)
            self.lost += 1
        worker.begin(None, 0.0, False)
        self._push(self.now + self.farm.back_s, "came_back", worker)
        for other in (w for m in self.machines for w in m.workers if w.idle and self.waiting):
            self._take(other)
        self._plan(worker.machine)

    def _came_back(self, worker: _Worker) -> None:
        worker.machine.go_on(self.now)
        worker.begin(None, self.farm.start_s, True)
        self._plan_failure(worker)
        self._plan(worker.machine)
