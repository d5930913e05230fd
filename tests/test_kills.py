"""A run that is killed while it writes loses nothing; every rename: `python tests/kills.py`."""

import shutil

import kills
import pytest


@pytest.fixture(scope="module")
def finished(demo_folder, tmp_path_factory):
    """A project after a run that nobody killed, its files, and its number of renames."""
    root = tmp_path_factory.mktemp("kills")
    shutil.copytree(demo_folder, root / "start")
    (root / "start" / "project.toml").write_text(
        "[unwrap]\npage_size = 512\nmax_pages = 1\n[refine]\nenabled = false\n"
    )
    for photo in (root / "start" / "photos").iterdir():
        if not (root / "start" / "correspondences" / f"{photo.stem}.csv").exists():
            photo.unlink()  # what is killed is writing: two photos with picks write as well
    whole = shutil.copytree(root / "start", root / "whole")
    done = kills.run(whole)
    assert done.returncode == 0, done.stderr
    return root, kills.result(whole), int(done.stdout.split()[-1])


@pytest.mark.parametrize("part", [0.1, 0.8])
def test_a_kill_at_a_rename_does_no_harm(finished, part):
    """The next run ends well, leaves no temporary file and has registered the same photos."""
    root, right, renames = finished
    copy = shutil.copytree(root / "start", root / f"killed at {part}")

    assert kills.run(copy, max(1, round(part * renames))).returncode == kills.KILLED
    kills.age(copy)

    assert kills.harm(copy, right) == ""
