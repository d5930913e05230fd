"""The film of a model on a turntable."""

import numpy as np
import pytest
from PIL import Image
from test_color_occluders import colored, photos, project_of

from texproj.cli.program import run
from texproj.errors import InputError, UsageError
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.turning import TurntableOptions, turn_project


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    root = tmp_path_factory.mktemp("wall")
    project_of(root, photos())
    colored(root)
    return root


def frames_of(path):
    """(n, h, w, 3) and the milliseconds of each."""
    out, times = [], []
    with Image.open(path) as film:
        for k in range(film.n_frames):
            film.seek(k)
            out.append(np.asarray(film.convert("RGB"), int))
            times.append(film.info["duration"])
    return np.array(out), times


@pytest.mark.parametrize("film", ["webp", "gif"])
def test_a_film_is_one_turn(wall, film):
    """So many frames in so many seconds; after half a turn the other side is seen, and from the
    side a wall is thin.
    """
    asked = ["--frames", "8", "--seconds", "2", "--size", "64", "--film", film]
    assert run(["turntable", str(wall), *asked]) == 0
    frames, times = frames_of(wall / f"out/turntable.{film}")

    assert frames.shape == (8, 64, 64, 3)
    assert times == [250] * 8
    shown = (np.abs(frames - 43).max(axis=-1) > 25).mean(axis=(1, 2))
    assert shown[0] > 0.3 and shown[4] > 0.3
    assert shown[2] < 0.5 * shown[0]


def test_pictures_of_each_frame(wall):
    """Numbered so that other programs can make a film of them."""
    with Workbench(Project.open(wall)) as bench:
        outcome = turn_project(bench, TurntableOptions("png", 3, size=48))

    assert [path.name for path in outcome.files] == [f"turntable_00{k}.png" for k in range(3)]
    with Image.open(outcome.files[1]) as picture:
        assert picture.size == (48, 48)


def test_what_cannot_be_filmed_is_refused(tmp_path, wall):
    """No model, no turn, no memory: a sentence each, and nothing is written."""
    project_of(tmp_path, photos())
    with Workbench(Project.open(tmp_path)) as bench, pytest.raises(InputError, match="color"):
        turn_project(bench, TurntableOptions())
    for frames, size in ((1, 64), (72, 8), (720, 2160)):
        with pytest.raises(UsageError):
            TurntableOptions("gif", frames, size=size)
    assert run(["turntable", str(wall), "--seconds", "0"]) == 2
