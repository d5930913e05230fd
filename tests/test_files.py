"""Writing: all or nothing, and the old content survives every failure."""

import errno
import subprocess
import sys
from pathlib import Path

import pytest

from texproj import files
from texproj.errors import OutputError
from texproj.files import json_hash, remove_unfinished, staging, write_atomically


def test_nothing_but_the_file_is_left(tmp_path):
    """The temporary folder is gone after a write."""
    write_atomically(tmp_path / "deep" / "a.txt", "text")

    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["a.txt"]
    assert (tmp_path / "deep" / "a.txt").read_text() == "text"


def test_a_full_disk_leaves_the_old_file(tmp_path, monkeypatch):
    """ENOSPC in the middle of a write is one sentence, and the old content is intact."""
    path = tmp_path / "a.txt"
    path.write_text("old")

    def full(self, data):
        with self.open("wb") as file:
            file.write(data[:2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match=r"disk is full.*unchanged"):
        write_atomically(path, "new")
    monkeypatch.undo()

    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_an_interrupt_leaves_the_old_files(tmp_path):
    """Ctrl-C between two files of a group replaces neither."""
    (tmp_path / "a").write_text("old a")
    (tmp_path / "b").write_text("old b")
    with pytest.raises(KeyboardInterrupt), staging(tmp_path) as folder:
        (folder / "a").write_text("new a")
        raise KeyboardInterrupt

    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a": "old a", "b": "old b"}


def test_a_path_through_a_file_is_refused(tmp_path):
    """A folder that cannot be is named."""
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="out: "):
        write_atomically(tmp_path / "out" / "model.ply", b"")


def test_a_folder_in_the_way_leaves_all_files(tmp_path):
    """A folder of the name of one of several files is named; none of the files has changed."""
    (tmp_path / "a").write_text("old a")
    (tmp_path / "b").mkdir()
    with (
        pytest.raises(OutputError, match="b: there is a folder of that name"),
        staging(tmp_path) as folder,
    ):
        (folder / "a").write_text("new a")
        (folder / "b").write_text("new b")

    assert (tmp_path / "a").read_text() == "old a"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]


def test_the_order_of_keys_does_not_change_a_hash():
    """Settings written in another order are the same settings."""
    assert json_hash({"a": 1, "b": [2.5]}) == json_hash({"b": [2.5], "a": 1})
    assert json_hash({"a": 1}) != json_hash({"a": 2})


def test_what_somebody_is_at_work_on_stays(tmp_path):
    """Another writer's folder is no left-over while that writer lives."""
    script = (
        "import sys, time; from pathlib import Path; from texproj.files import staging\n"
        f"with staging(Path({str(tmp_path)!r})) as folder:\n"
        "    (folder / 'a').write_text('half'); print('in', flush=True); sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as writer:
        assert writer.stdout.readline() == "in\n"
        write_atomically(tmp_path / "b", "mine")
        remove_unfinished(tmp_path)
        writer.stdin.close()

    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a": "half", "b": "mine"}


def test_what_a_killed_writer_left_goes_with_the_next_write(tmp_path):
    """The system lets go of its claim, so nobody has to remember it."""
    script = (
        "import os; from pathlib import Path; from texproj.files import staging\n"
        f"with staging(Path({str(tmp_path)!r})) as folder:\n"
        "    (folder / 'a').write_text('half'); os._exit(9)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=False)
    assert [p.name.startswith(".unfinished-") for p in tmp_path.iterdir()] == [True]

    write_atomically(tmp_path / "b", "mine")

    assert [p.name for p in tmp_path.iterdir()] == ["b"]


def test_a_folder_without_a_claim_is_left_alone_while_it_is_new(tmp_path, monkeypatch):
    """It may belong to somebody who is just making it."""
    (tmp_path / ".unfinished-x").mkdir()
    remove_unfinished(tmp_path)
    assert (tmp_path / ".unfinished-x").exists()

    monkeypatch.setattr(files, "FRESH_S", 0)
    remove_unfinished(tmp_path)
    assert not (tmp_path / ".unfinished-x").exists()
