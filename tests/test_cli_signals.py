"""Stopping is answered in a sentence at any moment; commands that read write nothing."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from texproj.cli import main
from texproj.cli.exits import STOP


def listing(folder):
    """Every file with its time, so that a rewrite shows too."""
    return {str(p.relative_to(folder)): p.stat().st_mtime_ns for p in sorted(folder.rglob("*"))}


STOPPED_WHILE_LOADING = """
import os, sys

class Stopper:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            exec("os.kill(os.getpid(), {asked})")

sys.meta_path.insert(0, Stopper())
from texproj.cli import main
from texproj.cli.exits import STOP
sys.exit(main(["run", {folder!r}]))
"""
"""A run that is asked to stop when it comes to load `module`, inside `exec` of a text."""


@pytest.mark.parametrize("asked", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("module", ["cyclopts", "texproj.options.color", "texproj.solve.lm"])
def test_whoever_stops_a_run_is_answered(project_folder, tmp_path, asked, module):
    """Also while modules are loaded: by a sentence and the exit code, not by the signal.

    As a module, since only then CPython may end the process by SIGINT after all.
    """
    code = STOPPED_WHILE_LOADING.format(module=module, asked=int(asked), folder=str(project_folder))
    (tmp_path / "stopped_run.py").write_text(code)
    done = subprocess.run(
        [sys.executable, "-m", "stopped_run"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
    )

    assert "Traceback" not in done.stderr
    assert "stopped; what was done is kept" in done.stderr
    assert done.returncode == 130


def test_what_a_library_makes_of_the_request_is_answered_too(monkeypatch, capsys):
    """An error of its own, raised because the request came in the midst of its work."""

    def turned(_):
        STOP.set()
        raise RuntimeError("in the midst")

    monkeypatch.setattr("texproj.cli.program.run", turned)

    assert main([]) == 130
    assert "stopped" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["status"], ["export", "--format", "colmap", "--to", "x"]])
def test_commands_that_read_write_nothing_into_the_project(
    project_folder, tmp_path, monkeypatch, command
):
    """Nor do they take away what somebody is at work on."""
    monkeypatch.chdir(tmp_path)
    unfinished = project_folder / "out" / ".unfinished-abc"
    unfinished.mkdir(parents=True)
    (unfinished / "model.ply").write_text("half")
    os.utime(unfinished, (0, 0))
    before = listing(project_folder)

    main([command[0], str(project_folder), *command[1:]])

    assert listing(project_folder) == before


def test_what_nothing_uses_is_told_and_logged(project_folder, capsys):
    """A mask of no photo, by status and by a command that works."""
    (project_folder / "masks").mkdir(exist_ok=True)
    (project_folder / "masks" / "nobody.png").write_bytes(b"x")

    main(["status", str(project_folder)])
    assert "nobody.png is ignored: it belongs to no photo" in capsys.readouterr().err

    main(["report", str(project_folder)])
    assert "nobody.png is ignored" in capsys.readouterr().err
    facts = json.loads((project_folder / "out" / "report.json").read_text())
    assert "nobody.png is ignored" in facts["ignored"][0]
    log = (project_folder / "work" / "log" / "texproj.log").read_text()
    assert "nobody.png is ignored" in log
    assert "report (texproj" in log


def test_what_nobody_foresaw_is_a_sentence_and_a_traceback_in_the_log(
    project_folder, capsys, monkeypatch
):
    """A fault of the program itself."""

    def fault(*_):
        raise ZeroDivisionError("inner")

    monkeypatch.setattr("texproj.stages.reporting.report_project", fault)
    assert main(["report", str(project_folder)]) == 2

    said = capsys.readouterr().err
    assert "internal fault (ZeroDivisionError: inner), please report" in said
    assert "Traceback" not in said
    log = (project_folder / "work" / "log" / "texproj.log").read_text()
    assert "Traceback" in log
    assert "ZeroDivisionError" in log


def test_a_bundle_is_written_where_one_stands(project_folder, tmp_path, monkeypatch, capsys):
    """`doctor --bundle` names the file and what it does not hold."""
    monkeypatch.chdir(tmp_path)
    assert main(["doctor", "--bundle", str(project_folder)]) == 0

    assert "no photo, no mask, no mesh" in capsys.readouterr().out
    assert Path("stele-report.zip").is_file()
