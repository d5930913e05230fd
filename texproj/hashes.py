"""Hashes of files by their content, computed again only where a file has changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from texproj.files import file_hash

UNREADABLE = "cannot be read"
"""In place of the hash of a file that may not be read."""


class KnownHashes:
    """What files were hashed to, with their size and time then."""

    def __init__(self, record: dict[str, Any]) -> None:
        """record: of an earlier run; what is no entry in it is left out."""
        self._known = {k: v for k, v in record.items() if isinstance(v, list) and len(v) == 2}

    @property
    def record(self) -> dict[str, Any]:
        """By path: size and time, and the hash; for the next run."""
        return self._known

    def of(self, path: Path) -> str | None:
        """Hash of a file; None where there is none; one that may not be read has a hash too, since
        whoever needs its content says what is wrong.
        """
        if not path.is_file():
            return None
        stamp = [(stat := path.stat()).st_size, stat.st_mtime_ns]
        known = self._known.get(str(path))
        if known is None or known[0] != stamp:
            try:
                self._known[str(path)] = known = [stamp, file_hash(path)]
            except OSError:
                return UNREADABLE
        return str(known[1])
