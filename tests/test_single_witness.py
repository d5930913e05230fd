"""A photo for which a single registered one vouches is believed where the mesh's edges say so."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from block_scenes import FULL, SIZE, Wall

from texproj.camera import Camera
from texproj.options import StructureOptions
from texproj.records import CameraRecord, Fit
from texproj.render import ambient_occlusion
from texproj.render.rays import CPURenderer
from texproj.stages.outcomes import CONTRADICTED
from texproj.stages.single_witness import borne_out

NAME, OTHER = "0.jpg", "3.jpg"
WIDTH = FULL * SIZE[0]


@lru_cache(maxsize=2)
def drawn(seed: int):
    mesh = Wall(seed).mesh
    return CPURenderer().load(mesh, ambient_occlusion(mesh, 32))


def off_by(percent: float) -> Camera:
    """The photo's true camera, turned aside."""
    true = Wall(0).cameras[NAME]
    angle = percent / 100 * WIDTH / true.intrinsics.fx
    return replace(true, pose=true.pose.step([0, angle, 0, 0, 0, 0]))


def told(percent: float, method: str = "import", mesh: int = 0) -> Fit:
    """What becomes of a fit that is off by a part of the width and expects 2 pixels."""
    true = Wall(0).cameras[OTHER]
    witness = CameraRecord(
        OTHER, WIDTH, true.height, true.intrinsics, true.pose, "registered", method
    )
    fit = Fit(off_by(percent), "features", 2.0, np.zeros(40), np.ones(40, bool), np.eye(6))
    return borne_out(
        fit,
        witness,
        Wall(0).photos[NAME],
        lambda camera: drawn(mesh).gbuffer(camera, ("depth", "normal", "ao", "front")),
        StructureOptions(working_px=SIZE[0]),
        Wall(mesh).mesh.vertices,
    )


def test_edges_bear_a_right_camera_out():
    found = told(0.05)

    assert found.accepted
    assert found.quality["support"] > 0.33


def test_a_witness_that_is_off_is_contradicted():
    """Both photos would agree with each other: the second was found through the first."""
    found = told(3.0)

    assert not found.accepted
    assert OTHER in found.reason
    assert found.reason.endswith(CONTRADICTED)


@pytest.mark.parametrize(("method", "believed"), [("import", False), ("points", True)])
def test_where_edges_do_not_tell_the_witness_must_be_proved(method, believed):
    """On a mesh of something else nothing is found; picks are their own proof."""
    found = told(0.0, method, mesh=1)

    assert found.accepted == believed
    assert believed or "pick 8 points" in found.reason
