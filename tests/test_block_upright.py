"""Which way up a block belongs, where somebody said so: it breaks ties and forbids nothing."""

from types import SimpleNamespace

import numpy as np
import pytest
from block_scenes import Wall

from texproj.camera import Camera, Pose
from texproj.errors import UsageError
from texproj.register.block.rotations import spread_rotations
from texproj.register.block.search import NOBODY, Search
from texproj.register.block.upright import Upright
from texproj.settings import read_settings

UNTURNED, HEAD_OVER = np.eye(3), np.diag([1.0, -1.0, -1.0])


def upright(turn=UNTURNED, measured=()):
    """Six photos of a wall, upward is -y, turned as a block is. measured: (3,) by some."""
    cameras = tuple(
        Camera(c.intrinsics, Pose(c.pose.R @ turn.T, c.pose.t)) for c in Wall(0).cameras.values()
    )
    names = tuple("abcdef")
    block = SimpleNamespace(cameras=cameras, names=names)
    return Upright.of(block, (0, -2, 0), dict(zip(names, measured, strict=False)))


def place(R, support):
    placed = SimpleNamespace(world_from_block=SimpleNamespace(R=R))
    return SimpleNamespace(placed=placed, support=support)


def search(known):
    return Search((), (), NOBODY, known)


def test_the_photos_know_what_is_upward_in_their_own_frame():
    turn = spread_rotations(7)[4]
    known = upright(turn)

    assert known.holds(turn.T)
    assert not known.holds(HEAD_OVER @ turn.T)
    assert known.in_block @ turn @ (0, -1, 0) > np.cos(np.radians(10))


def test_what_cameras_have_measured_counts_before_how_they_are_held():
    """Two that look straight down, as from a drone: what is up in their pictures says nothing."""
    down = (0.0, 0.0, -1.0)
    ahead = [c.pose.R[2] for c in Wall(0).cameras.values()][:2]
    known = upright(measured=(down, down, ()))

    mean = np.mean(ahead, axis=0)
    assert known.in_block @ mean < -0.999 * np.linalg.norm(mean)


def test_a_quarter_of_all_rotations_is_tried_first():
    """Those within 60 degrees: half of 1 - cos 60."""
    assert upright().holds(spread_rotations(552)).mean() == pytest.approx(0.25, abs=0.02)


def test_upside_down_loses_a_tie_and_wins_where_nothing_else_fits():
    tie = [place(HEAD_OVER, 0.7), place(np.eye(3), 0.68)]
    clear = [place(HEAD_OVER, 0.7), place(np.eye(3), 0.05)]
    known, unknown = search(upright()), search(None)

    assert known._ranked(tie)[0] is tie[1]
    assert unknown._ranked(tie)[0] is tie[0]
    assert known._ranked(clear)[0] is clear[0]
    assert known.rivalry(tie[1], tie[0]) < tie[1].support / 2.5
    assert known.rivalry(clear[0], clear[1]) == clear[1].support
    assert unknown.rivalry(tie[1], tie[0]) == 0.7


@pytest.mark.parametrize(
    ("text", "stands"),
    [("", None), ('[output]\nup = "auto"\n', None), ('[output]\nup = "z"\n', "z"),
     ('[output]\nup = "y"\n', "y"), ("[output]\nnormals = true\n", None)],
)  # fmt: skip
def test_up_is_known_only_where_somebody_said_it(text, stands):
    assert read_settings(text, "project.toml").stands == stands


def test_it_is_no_key_of_its_own():
    with pytest.raises(UsageError, match="stands"):
        read_settings('stands = "z"\n', "project.toml")
