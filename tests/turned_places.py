"""A question which of several places is right, in the form in which the stage writes it."""

import numpy as np

from texproj.camera import Camera, Pose
from texproj.register.block.block_fit import BlockFit, Candidate
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.similarity import Similarity
from texproj.stages.choosing import ask

HALF_TURN = np.diag([-1.0, -1.0, 1.0])
"""Of the plate of blocks, which it nearly fits."""


def turned(camera: Camera) -> Camera:
    """The camera after half a turn of the world about z."""
    return Camera(camera.intrinsics, Pose(camera.pose.R @ HALF_TURN, camera.pose.t))


def ask_about(project, places, support=(0.33, 0.31, 0.3)):
    """Ask which of `places`, each a camera for each photo, is right; as a search would."""
    rng = np.random.default_rng(0)
    names = tuple(project.photo_names)
    points = rng.uniform((-1.8, -1.3, 0.1), (1.8, 1.3, 0.6), (400, 3))
    nothing = np.zeros((0, 2), np.float32)
    block = Reconstruction(
        names, tuple(places[0]), ("lens",) * len(names), points, np.ones(400), np.ones(400),
        np.zeros(401, int), np.zeros(0, int), nothing,
    )  # fmt: skip
    candidates = tuple(
        Candidate(
            Similarity.identity(),
            dict(zip(names, cameras, strict=True)),
            dict.fromkeys(names, 1.2),
            share,
        )
        for cameras, share in zip(places, support, strict=False)
    )
    fit = BlockFit(
        Similarity.identity(), np.zeros(7), np.zeros(3), candidates[0].cameras,
        candidates[0].expected_error_px, support[0], support[1], 0.0, False,
        "the photos fit the mesh in two places", candidates, {"photos_asked": [*names]},
    )  # fmt: skip
    ask(project, block, fit)
