"""A fault can be reported: the log tells what happened, the bundle holds no picture."""

import logging
import zipfile

import pytest

from texproj.bundle import write_bundle
from texproj.doctor import Finding
from texproj.errors import OutputError, UsageError
from texproj.log import logged, logger


def test_the_log_names_version_machine_and_every_refusal(tmp_path):
    """The first line of a run says what ran; tracebacks stand below."""
    with logged(tmp_path / "log", "register") as path:
        logging.getLogger("texproj.stages").warning("a.jpg: refused")
        try:
            raise ValueError("inner")
        except ValueError:
            logger.exception("internal fault")
    logger.warning("after the run")

    text = path.read_text()
    first = text.splitlines()[0]
    assert "register (texproj" in first
    assert "numpy" in first
    assert "a.jpg: refused" in text
    assert "ValueError: inner" in text
    assert "after the run" not in text


def test_names_that_are_no_text_do_not_stop_the_log(tmp_path, monkeypatch):
    """A stray byte of a file name is written as an escape."""
    monkeypatch.setattr(logger, "propagate", False)  # what runs the tests could not pass it on
    with logged(tmp_path, "status") as path:
        logger.warning("a\udcff.jpg")

    assert "a\\udcff.jpg" in path.read_text()


def test_a_name_with_a_line_break_makes_no_line_of_its_own(tmp_path):
    """It could look like an entry; a traceback keeps its lines."""
    with logged(tmp_path, "status") as path:
        logger.warning("%s: refused", "a\n2026-01-01 INFO b\x1b[2J.jpg")

    assert path.read_text().splitlines()[-1].endswith(r"a\n2026-01-01 INFO b\x1b[2J.jpg: refused")


def test_a_log_that_cannot_be_written_is_one_sentence(tmp_path):
    """A file stands where the folder should be."""
    (tmp_path / "log").write_text("x")
    with pytest.raises(OutputError, match="cannot write"), logged(tmp_path / "log", "run"):
        pass


def test_a_bundle_holds_no_picture_and_nothing_from_outside(project_folder, tmp_path):
    """Photos, meshes and masks stay at home; so does what a link points to."""
    secret = tmp_path / "secret"
    secret.write_text("password")
    (project_folder / "correspondences" / "x.csv").symlink_to(secret)
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "a.json").write_text("password")
    (project_folder / "work").mkdir(exist_ok=True)
    (project_folder / "work" / "elsewhere").symlink_to(tmp_path / "records")
    with logged(project_folder / "work" / "log", "run"):
        pass
    names = write_bundle(project_folder, [Finding("system", True, "fine")], tmp_path / "fault.zip")
    with zipfile.ZipFile(tmp_path / "fault.zip") as bundle:
        inside = {name: bundle.read(name) for name in bundle.namelist()}

    assert set(names) == set(inside)
    assert {"doctor.txt", "cameras.json", "work/log/texproj.log"} <= set(inside)
    assert not any(name.endswith((".jpg", ".png", ".ply")) for name in inside)
    assert not any(b"password" in content for content in inside.values())
    assert b"scan.ply" in inside["files.json"]


def test_a_bundle_of_nothing_is_refused(tmp_path):
    """There is no project."""
    with pytest.raises(UsageError, match="no project"):
        write_bundle(tmp_path / "none", [], tmp_path / "fault.zip")
