"""How long many photos and faces take on many workers: a model of cost, simulated.

    python tests/simulate_scale.py [--photos 10000] [--megapixels 12] [--faces 50]
        [--workers 1,8,40] [--slow 0.02] [--hours 24] [--storage 1.0]
    python tests/simulate_scale.py --check [--check-photos 10,100,1000]

The first prints, for each number of workers (one processor each, four to a machine), the hours of
each stage and of all, what shared storage and the process that leads are busy with, and the memory
of a worker. --slow: part of the tasks that take five times as long; --hours: to the failure of a
worker, on average; --storage: GB per second of all together; --faces: millions.

--check measures small photos' features on 1, 2 and 4 local workers of a Dask cluster, predicts the
same from what one worker takes for ten of them and from the processors that as many processes get
before and after, and prints both: on the clock, and the workers' processor time. Floor: within
30 %. The clock says little where other work comes and goes.
"""

from __future__ import annotations

import argparse
import multiprocessing
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from discrete_events import Farm, Outcome, Stage, Task
from scale_project import make_photos

from texproj.project import Project
from texproj.resources.cluster import Cluster, cluster_at
from texproj.solve.features import find_features
from texproj.stages.bench import Workbench
from texproj.stages.sites import crew_of

GB = 1e9
WORKERS_EACH = 4
NETWORK = 1.2e9
"""Bytes per second into the process that leads: ten gigabits."""


@dataclass(frozen=True)
class Costs:
    """Processor seconds of one core (of two threads of it at work: times 1.3), and bytes. Measured
    by `tests/bench_many.py` (100 photos of 2.5 megapixels), `tests/bench_color.py`,
    `tests/bench_unwrap.py` and `tests/bench_cluster.py`, see docs/benchmarks.md; what is only
    supposed says so.
    """

    start_s: float = 2.5
    start_s_per_million_faces: float = 2.0
    decode_s_per_mp: float = 0.014
    jpeg_bytes_per_mp: float = 0.5e6
    features_s: float = 0.73
    features_bytes: float = 0.8e6
    pairs_per_photo: float = 17.0
    pair_s: float = 0.162
    motion_s_per_100: float = 320.0
    motion_power: float = 1.3
    """Supposed: it is run again as the model grows by a tenth."""
    block_s: float = 24.0
    ties_s: float = 0.36
    """One photo with its eight partners, one round."""
    rounds: int = 10
    ties_bytes: float = 0.3e6
    solve_s_per_photo: float = 0.006
    unwrap_s_per_million_faces: float = 16.0
    project_s: float = 0.25
    project_s_per_mp: float = 0.1
    sample_bytes_per_mp: float = 5e6
    """Half of a photo's pixels meet a texel of 10 bytes."""
    blend_s_per_gb: float = 12.0
    task_s: float = 0.003
    """What the scheduler and the process that leads have to do for any task."""
    worker_mb: float = 400.0
    worker_bytes_per_face: float = 400.0
    lead_mb: float = 420.0
    lead_bytes_per_face: float = 200.0
    """Between 1.5 and 5.5 million faces, with a texture: `tests/bench_faces.py --to texture`."""


COSTS = Costs()


@dataclass(frozen=True)
class Work:
    """A stage: tasks that workers share, then what the process that leads does alone."""

    name: str
    tasks: list[Task]
    alone_s: float = 0.0


def stages(photos: int, mp: float, millions: float, costs: Costs = COSTS) -> list[Work]:
    """All stages of `texproj run`."""
    photo = costs.jpeg_bytes_per_mp * mp
    decode, over = costs.decode_s_per_mp * mp, costs.task_s
    features = Task(costs.features_s + decode, photo, costs.features_bytes, over)
    pairs = Task(costs.pair_s * costs.pairs_per_photo, 0.0, 1e5, over)
    ties = Task(costs.ties_s + 9 * decode / costs.rounds, 9 * photo / costs.rounds,
                costs.ties_bytes, over)  # fmt: skip
    seen = costs.sample_bytes_per_mp * mp
    project = Task(costs.project_s + costs.project_s_per_mp * mp, photo, seen, over)
    blend = Task(costs.blend_s_per_gb * seen / GB, seen, seen / 100, over)
    motion = costs.motion_s_per_100 * (photos / 100) ** costs.motion_power
    return [
        Work("features", [features] * photos),
        Work("pairs", [pairs] * photos),
        Work("motion", [], motion + costs.block_s),
        Work("refine", [ties] * photos * costs.rounds,
             costs.solve_s_per_photo * photos * costs.rounds),
        Work("unwrap", [], costs.unwrap_s_per_million_faces * millions),
        Work("project", [project] * photos),
        Work("blend", [blend] * photos),
    ]  # fmt: skip


def simulated(work: Work, farm: Farm, seed: int = 0) -> Outcome:
    """One stage on a farm whose workers are up."""
    if not work.tasks:
        return Outcome(work.alone_s, 0, 0.0, 1.0)
    found = Stage(farm, work.tasks, seed, started=False).run()
    return Outcome(found.seconds + work.alone_s, found.lost, found.storage, found.lead)


def tell(options: argparse.Namespace) -> None:
    """Print the table of a large project."""
    work, costs = stages(options.photos, options.megapixels, options.faces), COSTS
    start = costs.start_s + costs.start_s_per_million_faces * options.faces
    print(f"{options.photos} photos of {options.megapixels:g} MP, {options.faces:g} M faces; hours")
    print("workers " + "".join(f"{one.name:>10}" for one in work) + "       all  busiest")
    for workers in map(int, options.workers.split(",")):
        farm = Farm(
            machines=-(-workers // WORKERS_EACH), workers_each=min(workers, WORKERS_EACH),
            processors_each=min(workers, WORKERS_EACH), start_s=start,
            storage=options.storage * GB, network=NETWORK, slow_share=options.slow,
            hours_to_failure=options.hours,
        )  # fmt: skip
        found = [simulated(one, farm) for one in work]
        hours = [one.seconds / 3600 for one in found]
        longest = int(np.argmax(hours))
        what = max(("storage", found[longest].storage), ("lead", found[longest].lead),
                   key=lambda pair: pair[1])  # fmt: skip
        lost = sum(one.lost for one in found)
        cells = "".join(f"{h:10.2f}" for h in (*hours, sum(hours)))
        busiest = f"{work[longest].name}, its {what[0]} {what[1]:.0%}"
        print(f"{workers:7d} {cells}  {busiest}, lost {lost}")
    mesh_gb = 1e6 * options.faces / GB
    samples_gb = options.photos * costs.sample_bytes_per_mp * options.megapixels / GB
    each_gb = costs.worker_mb / 1e3 + costs.worker_bytes_per_face * mesh_gb
    lead_gb = costs.lead_mb / 1e3 + costs.lead_bytes_per_face * mesh_gb
    print(f"a worker {each_gb:.1f} GB, who leads {lead_gb:.1f} GB, on disk {samples_gb:.0f} GB")


# --- the model against this machine


def features_of(bench: Workbench, name: str) -> float:
    """Processor seconds that a photo took here."""
    begun = time.process_time()
    bench.features(name)
    return time.process_time() - begun


def nothing(_bench: Workbench) -> None:
    """A task that does nothing."""


def share_got(seconds: float) -> float:
    """Part of a processor that one process gets, while it does the work of a task for so long."""
    cv2.setNumThreads(1)
    gray = np.random.default_rng(0).random((SIDE, SIDE)).astype(np.float32)
    begun, spent_before = time.perf_counter(), time.process_time()
    while time.perf_counter() - begun < seconds:
        find_features(cv2.GaussianBlur(gray, (0, 0), 2), None)
    return (time.process_time() - spent_before) / (time.perf_counter() - begun)


SIDE = 400
"""Of the small photos, pixels."""
LISTENING_S = 2.0


def processors(workers: int) -> float:
    """How many processors so many processes get, as this machine is now."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(workers) as pool:
        pool.map(share_got, [0.1] * workers, chunksize=1)  # loads programs
        return sum(pool.map(share_got, [LISTENING_S] * workers, chunksize=1))


def check(counts: list[int]) -> None:
    """Print predicted and measured seconds."""
    with tempfile.TemporaryDirectory() as folder:
        project = make_photos(Path(folder) / "many", max(counts), side=SIDE)
        costs = measured_costs(project)
        print(f"a photo {costs.features_s:.3f} s, any task {costs.task_s * 1e3:.1f} ms,"
              f" a worker's start {costs.start_s:.1f} s")  # fmt: skip
        print("photos workers   predicted  measured  ratio   processor time: the same")
        for workers in (1, 2, 4):
            for photos in counts:
                before = processors(workers)
                real, real_cpu = on_cluster(project, photos, workers)
                share = (before + processors(workers)) / 2
                farm = Farm(1, workers, share, costs.start_s, network=np.inf)
                tasks = [Task(costs.features_s, lead_s=costs.task_s)] * photos
                told = Stage(farm, tasks, 0, started=False).run().seconds
                told_cpu = photos * costs.features_s + workers * costs.start_s
                print(f"{photos:6d} {workers:7d} {told:11.1f} {real:9.1f} {told / real:6.2f}"
                      f" {told_cpu:15.1f} {real_cpu:9.1f} {told_cpu / real_cpu:6.2f}",
                      flush=True)  # fmt: skip


def measured_costs(project: Project) -> Costs:
    """What one worker takes for some photos, for nothing, and to begin."""
    names = project.photo_names[:11]
    with cluster_at("local:1") as cluster, crew_of(cluster, project) as crew:
        before = spent(cluster)
        crew.submit(features_of, names[0]).result(quiet)
        first = spent(cluster) - before
        photo = float(np.mean([crew.submit(features_of, n).result(quiet) for n in names[1:]]))
        begun = time.perf_counter()
        for pending in [crew.submit(nothing) for _ in range(200)]:
            pending.result(quiet)
        over = (time.perf_counter() - begun) / 200
    return Costs(start_s=max(first - photo, 0.0), features_s=photo, task_s=over)


def spent(cluster: Cluster) -> float:
    """Processor seconds of all workers."""
    return sum(cluster.everywhere(time.process_time).values())


def on_cluster(project: Project, photos: int, workers: int) -> tuple[float, float]:
    """Seconds on the clock for the features of photos, workers' start included; those of the
    workers' processors.
    """
    with cluster_at(f"local:{workers}") as cluster, crew_of(cluster, project) as crew:
        before, begun = spent(cluster), time.perf_counter()
        for pending in [crew.submit(features_of, n) for n in project.photo_names[:photos]]:
            pending.result(quiet)
        return time.perf_counter() - begun, spent(cluster) - before


def quiet() -> None:
    """Nobody asks to stop."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--photos", type=int, default=10_000)
    parser.add_argument("--megapixels", type=float, default=12.0)
    parser.add_argument("--faces", type=float, default=50.0)
    parser.add_argument("--workers", default="1,4,16,64,200")
    parser.add_argument("--slow", type=float, default=0.02)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--storage", type=float, default=1.0)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--check-photos", default="10,100,1000")
    options = parser.parse_args()
    if options.check:
        check([int(n) for n in options.check_photos.split(",")])
    else:
        tell(options)


if __name__ == "__main__":
    main()
