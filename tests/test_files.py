"""Writing: all or nothing, and the old content survives every failure."""

import errno
from pathlib import Path

import pytest

from texproj.errors import OutputError
from texproj.files import json_hash, staging, write_atomically


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


def test_the_order_of_keys_does_not_change_a_hash():
    """Settings written in another order are the same settings."""
    assert json_hash({"a": 1, "b": [2.5]}) == json_hash({"b": [2.5], "a": 1})
    assert json_hash({"a": 1}) != json_hash({"a": 2})
