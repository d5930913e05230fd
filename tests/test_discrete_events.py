"""The simulation of many workers, where paper tells the answer."""

import itertools
import math

import pytest
from discrete_events import Farm, Stage, Task
from simulate_scale import simulated, stages


def seconds(farm: Farm, tasks: list[Task], started: bool = True) -> float:
    return Stage(farm, tasks, 0, started).run().seconds


def test_one_worker_does_one_after_the_other():
    assert seconds(Farm(start_s=3.0), [Task(1.5)] * 10, started=False) == pytest.approx(18.0)


def test_workers_share_the_processors_of_their_machine():
    """Four on two processors are as fast as two; on two machines of two, twice as fast."""
    tasks = [Task(1.0)] * 100

    assert seconds(Farm(1, 4, 2.0), tasks) == pytest.approx(50.0)
    assert seconds(Farm(2, 2, 2.0), tasks) == pytest.approx(25.0)


def test_storage_and_who_leads_do_one_thing_at_once():
    """However many workers there are: a hundred reads of a second, or a hundred answers."""
    many = Farm(200, 1, 1.0, storage=1e9, network=1e9)

    assert seconds(many, [Task(1.0, read=1e9)] * 100) == pytest.approx(101.0)
    assert seconds(many, [Task(1.0, returned=0.5e9, lead_s=0.5)] * 100) == pytest.approx(101.0)


def test_a_straggler_holds_up_its_stage():
    slow = Farm(10, 1, 1.0, slow_share=1.0, slow_factor=5.0)

    assert seconds(slow, [Task(1.0)] * 10) == pytest.approx(5.0)


def test_tasks_of_workers_that_die_are_done_by_others():
    """All are done; the time lost is that of the lost tasks and of the workers' absence."""
    safe = Farm(4, 1, 1.0, start_s=10.0)
    frail = Farm(4, 1, 1.0, start_s=10.0, hours_to_failure=0.05, back_s=30.0)
    tasks = [Task(5.0)] * 400
    told = Stage(frail, tasks, 1, started=True).run()

    assert told.lost > 4
    assert seconds(safe, tasks) < told.seconds < 2 * seconds(safe, tasks)


def test_more_workers_are_never_slower_and_never_faster_than_what_leads():
    """A thousand photos: what the process that leads does alone stays, however many workers."""
    work = stages(1000, 12.0, 5.0)
    alone = sum(one.alone_s for one in work)
    times = [sum(simulated(one, Farm(n, 1, 1.0)).seconds for one in work) for n in (1, 4, 16, 64)]

    assert all(a > b > alone for a, b in itertools.pairwise(times))
    assert math.isclose(times[0] - times[1], (times[0] - alone) * 3 / 4, rel_tol=0.05)
