"""Two writers on one project: the second waits and says for whom."""

import subprocess
import sys
import threading

import pytest

from texproj.at_work import at_work
from texproj.errors import OutputError

HOLD = """
import sys; from pathlib import Path; from texproj.at_work import at_work
with at_work(Path(sys.argv[1]), "color", print):
    print("in", flush=True); sys.stdin.read()
"""


def holder(folder):
    """Another process that holds the folder until its input ends."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "in\n"
    return process


def test_the_second_writer_waits_and_names_the_first(tmp_path):
    """It goes on as soon as the first has ended."""
    said = []
    with holder(tmp_path / "work") as first:
        threading.Timer(0.5, first.stdin.close).start()
        with at_work(tmp_path / "work", "refine", said.append):
            assert first.wait(timeout=10) == 0

    assert len(said) == 1
    assert f"`texproj color` (process {first.pid}" in said[0]
    assert not (tmp_path / "work" / "at-work.json").exists()


def test_a_killed_writer_holds_nothing(tmp_path):
    """The system lets go of what it held."""
    said = []
    with holder(tmp_path / "work") as first:
        first.kill()
        first.wait()
        with at_work(tmp_path / "work", "run", said.append):
            pass

    assert said == []


def test_a_writer_inside_a_writer_goes_on(tmp_path):
    """`run` calls what `color` calls."""
    with at_work(tmp_path, "run", pytest.fail), at_work(tmp_path, "color", pytest.fail):
        pass


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path):
    """A file stands in its place."""
    (tmp_path / "work").write_text("x")
    with pytest.raises(OutputError, match="cannot write"), at_work(tmp_path / "work", "run", print):
        pass
