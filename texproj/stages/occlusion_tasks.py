"""Ambient occlusion of the mesh, computed by all workers together, block by block of vertices."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from texproj.arrays import Floats
from texproj.resources.workers import WorkerLostError
from texproj.stages.bench import Crew, Workbench


def have_occlusion(bench: Workbench, crew: Crew, listen: Callable[[], None]) -> None:
    """Have it where the workers find it. listen: called several times a second; it may raise to
    stop the work.
    """
    if bench.kept_occlusion is None:
        bench.keep_occlusion(_computed(bench, crew, listen))
    crew.bring(bench.occlusion_path)


def _computed(bench: Workbench, crew: Crew, listen: Callable[[], None]) -> Floats:
    """(V,) one block a worker: each builds a tree of the whole mesh for its rays."""
    bounds = np.linspace(0, len(bench.mesh.vertices), max(crew.count, 1) + 1).astype(int).tolist()
    coming = [crew.submit(_block, first, end) for first, end in pairwise(bounds)]
    try:
        return np.concatenate([one.result(listen) for one in coming])
    except WorkerLostError:
        return bench.occlusion


# --- in a worker


def _block(bench: Workbench, first: int, end: int) -> Floats:
    from texproj.render import occlusion_of  # noqa: PLC0415 - slow to load

    return occlusion_of(bench.mesh, first, end)
