"""Where registered photos put a block, the other photos are asked: right, beside it, or far off."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from block_scenes import Wall, block_of, error_percent, random_similarity

from texproj.mesh import vertex_normals
from texproj.register.block.anchor import Anchored
from texproj.register.block.confirmation import Confirmation, confirmation
from texproj.render import ambient_occlusion
from texproj.render.rays import CPURenderer

ERROR_PX = 3.0
"""What the registered photos claim, of 1536."""


@lru_cache(maxsize=1)
def scene():
    """A wall, its block in a frame of its own, and how it is rendered."""
    wall, frame = Wall(0), random_similarity(np.random.default_rng(6))
    drawn = CPURenderer().load(wall.mesh, ambient_occlusion(wall.mesh, 32))
    return wall, block_of(wall.solid, wall.cameras, frame), frame.inverse, drawn


@lru_cache(maxsize=1)
def asked(turn_deg: float, shift: float) -> Confirmation:
    """What the photos say of a block that is turned and shifted by a part of the wall's width."""
    wall, block, true, drawn = scene()
    middle = wall.mesh.vertices.mean(axis=0)
    delta = [0, np.radians(turn_deg), 0, shift, 0, 0, 0]
    held = Anchored(
        world_from_block=true.step(delta, middle, 12.0),
        sigma=np.zeros(7),
        pivot=middle,
        expected_error_px=np.full(len(block.names), ERROR_PX),
        agreeing=np.ones(1),
        residual_px=1.0,
        contradicts=(),
    )
    return confirmation(
        block,
        held,
        wall.mesh,
        lambda camera: drawn.gbuffer(camera, ("depth", "normal", "ao", "front")),
        wall.photos.__getitem__,
    )


def errors_percent(found: Confirmation) -> list[float]:
    wall, block, _, _ = scene()
    normals = vertex_normals(wall.mesh)
    return [
        error_percent(camera, wall.cameras[name], wall.mesh.vertices, normals)
        for name, camera in found.cameras(block).items()
    ]


def test_the_right_place_is_borne_out():
    """Structure is found there and leads nowhere else."""
    found = asked(0, 0)

    assert found.agrees
    assert not found.contradicts
    assert found.support > 0.3
    assert not found.mirror.refused
    assert max(errors_percent(found)) < 0.3


def test_a_place_beside_the_right_one_is_contradicted_and_leads_home():
    """The registered photo is off by 3 % of the width and claims .2 %: the others show the
    structure where it is.
    """
    found = asked(1.5, 0.02)

    assert found.contradicts
    assert not found.agrees
    assert 1 < found.apart_percent < 6
    assert max(errors_percent(found)) < 0.3


def test_what_little_was_claimed_is_not_held_against_it():
    """The same distance is no contradiction where the registered photos claim as much."""
    found = asked(1.5, 0.02)
    far = replace(found, apart_sigma=2.0)

    assert far.agrees
    assert not far.contradicts


def test_a_place_far_off_is_borne_out_by_nothing():
    """Nothing is found there."""
    found = asked(40, 0.3)

    assert not found.agrees
    assert found.support < 0.15
