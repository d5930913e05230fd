"""Temporary disk space without a name: what does not have to stay in memory."""

from __future__ import annotations

import errno
import os
import tempfile
from threading import Lock

from texproj.errors import OutputError


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
                written = self._write(view, at)
                view, at = view[written:], at + written
        return start

    def _write(self, data: memoryview, at: int) -> int:
        try:
            return os.pwrite(self._file.fileno(), data, at)
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
                raise
            raise OutputError(
                f"the temporary folder {tempfile.gettempdir()} is full; free some space, or name"
                " another folder in the environment variable TMPDIR"
            ) from None

    def read(self, start: int, length: int) -> bytes:
        """`length` bytes from `start`."""
        return os.pread(self._file.fileno(), length, start)
