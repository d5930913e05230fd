"""Blocks of photos put onto the mesh without any start.

Reliefs of boxes, six photos of each by rays and shading of their own, and points with the noise
and outliers of structure from motion; mesh and block each in a random frame.
"""

from functools import lru_cache

import numpy as np
import pytest
from block_scenes import Wall, block_of, moved, random_similarity

from texproj.mesh import Mesh
from texproj.register.block.block_fit import BlockFit
from texproj.register.block.place import place_block
from texproj.register.block.similarity import Similarity
from texproj.render import ambient_occlusion
from texproj.render.rays import CPURenderer


@lru_cache(maxsize=4)
def wall(seed: int) -> Wall:
    return Wall(seed)


def placed(photographed: Wall, mesh: Mesh, frame: Similarity, seed: int = 0) -> BlockFit:
    """The block of a wall's photos, in a frame of its own, put onto a mesh."""
    scene = CPURenderer().load(mesh, ambient_occlusion(mesh, 32))
    return place_block(
        block_of(photographed, frame),
        mesh,
        lambda camera: scene.gbuffer(camera, ("depth", "normal", "ao", "front")),
        photographed.photos.__getitem__,
        seed=seed,
    )


def error_percent(fit: BlockFit, name: str, truth: Wall, world_from_wall: Similarity) -> float:
    """Mean distance of what the true camera sees, percent of the width."""
    camera = world_from_wall.camera(truth.cameras[name])
    points = world_from_wall.apply(truth.mesh.vertices)
    xy, _ = camera.project(points)
    inside = camera.inside(xy)
    gap = fit.cameras[name].project(points[inside])[0] - xy[inside]
    return float(100 * np.linalg.norm(gap, axis=1).mean() / camera.width)


@lru_cache(maxsize=2)
def right_case(seed: int) -> tuple[BlockFit, Similarity]:
    rng = np.random.default_rng(seed)
    world_from_wall = random_similarity(rng)
    mesh = moved(wall(0).mesh, world_from_wall)
    return placed(wall(0), mesh, random_similarity(rng)), world_from_wall


@pytest.mark.parametrize("seed", [1, 2])
def test_the_right_place_is_found_from_any_frame(seed):
    """Every photo is within .3 % of the width of the truth, accepted without any rival, and the
    error that is expected is of the size of the true one."""
    fit, world_from_wall = right_case(seed)
    errors = [error_percent(fit, name, wall(0), world_from_wall) for name in wall(0).cameras]

    assert max(errors) < 0.3
    assert fit.accepted, fit.reason
    assert fit.support > 0.3
    assert fit.support > 2.5 * fit.rival
    assert np.median(errors) / 3 < fit.expected_error_percent < 10 * np.median(errors)
