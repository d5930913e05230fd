"""Writing files so that a reader never meets half of one, and naming contents by their hash."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from texproj.errors import OutputError

STAGING_PREFIX = ".unfinished-"
"""Begins the names of folders in which files are made before they move to their place."""

CLAIM = ".claim"
"""Locked in such a folder by whoever works there; the system lets go of it when the process ends,
however it ends."""

FRESH_S = 10
"""Age below which a folder without a claim may belong to somebody who is just making it."""


def write_atomically(path: Path, content: bytes | str) -> None:
    """Write `content` beside `path`, then rename it there; the old file stays until then.

    Raises OutputError; the old file is intact.
    """
    data = content.encode() if isinstance(content, str) else content
    with staging(path.parent) as folder:
        (folder / path.name).write_bytes(data)


@contextlib.contextmanager
def staging(target: Path) -> Iterator[Path]:
    """A temporary folder inside `target`; what is in it moves to `target` when the block ends well.

    Files that are there already are replaced one by one, each atomically. What an interrupted write
    left in `target` is removed. Raises OutputError for a folder that cannot be written and for a
    full disk; nothing in `target` has changed then.
    """
    from filelock import FileLock  # noqa: PLC0415 - loads asyncio, which readers need not wait for

    folder = None
    try:
        target.mkdir(parents=True, exist_ok=True)
        remove_unfinished(target)
        folder = Path(tempfile.mkdtemp(prefix=STAGING_PREFIX, dir=target))
        with FileLock(folder / CLAIM):
            yield folder
            made = sorted(file for file in folder.iterdir() if file.name != CLAIM)
            for file in made:  # a folder would stop it halfway
                if (target / file.name).is_dir():
                    raise IsADirectoryError(errno.EISDIR, "a folder", str(target / file.name))
            for file in made:
                file.replace(target / file.name)
    except OSError as error:
        raise OutputError(write_failure(target, error)) from error
    finally:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)


def remove_unfinished(target: Path) -> None:
    """Delete what an interrupted write left in `target`; what somebody is at work on stays."""
    left = list(target.glob(f"{STAGING_PREFIX}*"))
    if not left:
        return
    from filelock import FileLock, Timeout  # noqa: PLC0415

    for folder in left:
        with contextlib.suppress(OSError, Timeout):
            if not (folder / CLAIM).exists() and time.time() - folder.stat().st_mtime < FRESH_S:
                continue  # made a moment ago, not yet claimed
            with FileLock(folder / CLAIM, timeout=0):
                pass
            shutil.rmtree(folder, ignore_errors=True)


def write_failure(target: Path, error: OSError) -> str:
    """Why `target` cannot be written, and what to do."""
    reasons = {
        errno.ENOSPC: "the disk is full; free some space",
        errno.EDQUOT: "the disk quota is used up; free some space",
        errno.EACCES: "it is not writable; check its permissions",
        errno.EPERM: "it is not writable; check its permissions",
        errno.EROFS: "it is on a read-only disk; use another place",
        errno.EEXIST: "there is a file of that name; move it away",
        errno.EISDIR: "there is a folder of that name; move it away",
        errno.ENOTDIR: "a part of that path is a file; move it away",
    }
    reason = reasons.get(error.errno or 0, f"{error.strerror or error}")
    if error.errno == errno.EISDIR and error.filename:
        target = Path(str(error.filename))
    return f"cannot write to {target}: {reason} (what was there before is unchanged)"


def content_hash(data: bytes) -> str:
    """Hash of some bytes, 32 hexadecimal digits."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def json_hash(value: Any) -> str:
    """Hash of a value that JSON can hold, independent of the order of keys."""
    return content_hash(json.dumps(value, sort_keys=True, separators=(",", ":")).encode())


def file_hash(path: Path) -> str:
    """Hash of a file's content."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def link_or_copy(source: Path, target: Path, link: bool) -> None:
    """Put `source` at `target`: a symbolic link if asked, else a copy. Raises OutputError."""
    try:
        if link:
            target.symlink_to(source.resolve())
        else:
            shutil.copyfile(source, target)
    except OSError as error:
        raise OutputError(write_failure(target, error)) from error


def read_json_object(path: Path) -> dict[str, Any]:
    """The object in a file that the machine made; empty if it is missing or broken."""
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}
