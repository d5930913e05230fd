"""Work tells how far it is: few lines in a log, with the time left once it can be known."""

import subprocess
import sys

import pytest

from texproj.cli import talk
from texproj.cli.progress import LINE_EVERY_S, progress_lines
from texproj.loading import when_used


def told(*steps):
    """The lines for steps of (seconds, stage, done, total, item)."""
    lines, now = [], [0.0]
    show = progress_lines(lines.append, lambda: now[0])
    for seconds, *step in steps:
        now[0] = seconds
        show(*step)
    return lines


def test_a_line_where_a_stage_begins():
    """Also where the one before it began a moment ago."""
    assert told((0, "register", 0, 3, "a.png"), (0.1, "color", 0, 2, "b.png")) == [
        "register: 0 of 3  a.png",
        "color: 0 of 2  b.png",
    ]


def test_nothing_is_told_twice():
    """Nor is "0 of 0", while it is not known how much there is to do."""
    steps = [(20.0 * i, "features", 0, 0, "") for i in range(3)]
    steps += [(80 + 20.0 * i, "features", 0, 9, "") for i in range(3)]

    assert told(*steps) == ["features: begins", "features: 0 of 9"]


def test_no_more_than_a_line_in_ten_seconds():
    """A log of an hour's work holds at most 360 lines beside the beginnings."""
    steps = [(0.1 * i, "register", i, 1000, "x.png") for i in range(1000)]

    assert len(told(*steps)) == 100 / LINE_EVERY_S


def test_the_time_left_follows_from_what_is_done():
    """A quarter took 20 s, so three quarters take 60 s; minutes where it is long."""
    lines = told((0, "refine", 0, 8, ""), (20, "refine", 2, 8, ""), (800, "refine", 4, 8, ""))

    assert lines[1:] == ["refine: 2 of 8, about 60 s left", "refine: 4 of 8, about 13 min left"]


def test_a_command_loads_no_more_than_it_needs():
    """The version is told without numerics: they take most of the time of a start."""
    code = (
        "import sys; from texproj.cli import main; main(['--version']);"
        "print(sorted({'numpy', 'cv2', 'pydantic', 'rich.markdown'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert done.stdout.splitlines()[-1] == "[]"


def test_status_loads_nothing_that_makes_results(tmp_path):
    """What is fresh is told without OpenCV, renderer, readers and writers: half of a start."""
    (tmp_path / "mesh").mkdir()
    (tmp_path / "mesh" / "scan.ply").write_text("ply")
    (tmp_path / "project.toml").touch()
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.jpg").write_bytes(b"")
    heavy = "cv2", "scipy", "texproj.render.gbuffer", "texproj.formats.photos.read"
    heavy += "texproj.formats.meshes.read", "texproj.formats.models", "texproj.stages.registering"
    code = (
        "import sys; from texproj.cli import main; main(['status', sys.argv[1]]);"
        f"print(sorted({set(heavy)} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", code, tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, check=True)

    assert "not made yet" in done.stdout
    assert done.stdout.splitlines()[-1] == "[]"


def test_no_module_hides_a_name_that_is_loaded_later():
    """A loaded module becomes an attribute of its package, in place of a function of its name."""
    with pytest.raises(ValueError, match="companions would be hidden"):
        when_used("texproj.formats.meshes", {"companions": "texproj.formats.meshes.companions"})


def test_names_do_not_command_the_terminal(capsys):
    """Escapes, line breaks and what is no UTF-8 are written out; accents stay."""
    talk.say("a\x1b[2Jb\rc\udcff\nd\u202eé中")
    talk.complain("x\x07")

    said = capsys.readouterr()
    assert said.out == "a\\x1b[2Jb\\rc\\udcff\\nd\\u202eé中\n"
    assert said.err == "texproj: x\\x07\n"
