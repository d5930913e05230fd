"""Temporary disk space without a name: what does not have to stay in memory."""

from __future__ import annotations

import os
import tempfile
from threading import Lock


class Scratch:
    """A growing unnamed file; the space goes back when it is closed, even if the process dies.

    Safe to use from several threads.
    """

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="texproj-")  # noqa: SIM115 - closed by close()
        self._end = 0
        self._lock = Lock()

    def close(self) -> None:
        """Give the space back."""
        self._file.close()

    @property
    def size(self) -> int:
        """Bytes written."""
        return self._end

    def append(self, *parts: bytes | memoryview) -> int:
        """Write the parts one after the other; returns where they begin."""
        length = sum(len(part) for part in parts)
        with self._lock:
            start = self._end
            self._end += length
        at = start
        for part in parts:
            view = memoryview(part)
            while view:
                written = os.pwrite(self._file.fileno(), view, at)
                view, at = view[written:], at + written
        return start

    def read(self, start: int, length: int) -> bytes:
        """`length` bytes from `start`."""
        return os.pread(self._file.fileno(), length, start)
