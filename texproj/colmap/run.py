"""Running COLMAP's process: it is fed, listened to, and ended whenever somebody asks for it."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from queue import Empty, Queue
from typing import IO, Any

from texproj.colmap.messages import (
    Awaited,
    Batch,
    Complete,
    Failed,
    Features,
    Matched,
    Picture,
    Result,
    Task,
    Told,
    Wanted,
    receive,
    send,
)
from texproj.errors import RegistrationError
from texproj.resources.workers import Pending

LISTEN_S = 0.25
"""Seconds between two chances to stop the work."""
LAST_WORDS = 40
"""Lines of what COLMAP prints that are logged when it fails."""

BEGIN = Told("features", 0, 0)

Listen = Callable[[str, int, int], None]
"""``listen(what, done, total)``, several times a second; it may raise to stop the work."""

Source = Callable[[Sequence[str]], Iterator[Picture | Features]]
"""Makes the pictures of some keys, or finds their features elsewhere."""
Match = Callable[[Batch], Pending[Matched]]
"""Has a batch matched elsewhere."""

logger = logging.getLogger(__name__)


def available() -> bool:
    """Whether COLMAP is installed here."""
    return find_spec("pycolmap") is not None


def run_colmap(task: Task, source: Source, listen: Listen, match: Match | None = None) -> Result:
    """What COLMAP makes of the photos of a task. source: is asked for those that it lacks; match:
    who matches pairs where the task has them matched elsewhere.

    The process is gone when this returns or raises. Raises RegistrationError where it cannot go
    on, and whatever `listen` raises.
    """
    with _process() as process:
        ears = _Ears(process, Queue(), deque(maxlen=LAST_WORDS), listen, BEGIN)
        ears.open()
        with suppress(OSError):  # of a broken pipe; what is heard tells why
            send(_pipe(process.stdin), task)
            for message in source(ears.next(Wanted).keys):
                send(_pipe(process.stdin), message)
                ears.listen_once()
            send(_pipe(process.stdin), Complete())
            if match is not None:
                return _matched_elsewhere(ears, match)
        return ears.next(Result)


def _matched_elsewhere(ears: _Ears, match: Match) -> Result:
    """The result, batches matched by others on the way."""
    coming: deque[Pending[Matched]] = deque()
    while not isinstance(message := ears.next(Batch | Awaited | Result), Result):
        if isinstance(message, Batch):
            coming.append(match(message))
        else:
            found = coming.popleft().result(ears.listen_once)
            send(_pipe(ears.process.stdin), found)
    return message


@contextmanager
def _process() -> Iterator[subprocess.Popen[bytes]]:
    """COLMAP's process; it ends with the block, whatever happens in it. Keys that interrupt this
    process do not reach it.
    """
    command = [sys.executable, "-m", "texproj.colmap.process"]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        start_new_session=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        with suppress(OSError):  # what the process did not take any more
            _pipe(process.stdin).close()


@dataclass(eq=False)
class _Ears:
    """Hears what the process says. last: how far it was when it last said so."""

    process: subprocess.Popen[bytes]
    said: Queue[Any]
    printed: deque[str]
    listen: Listen
    last: Told

    def open(self) -> None:
        """Begin to hear; both threads end with the process."""
        for work in (self._hear, self._read):
            threading.Thread(target=work, daemon=True).start()

    def _hear(self) -> None:
        with _pipe(self.process.stdout) as stream:
            while (message := receive(stream)) is not None:
                self.said.put(message)
        self.said.put(None)

    def _read(self) -> None:
        with _pipe(self.process.stderr) as stream:
            for line in stream:
                self.printed.append(line.decode(errors="replace").rstrip())

    def listen_once(self) -> None:
        self.listen(self.last.what, self.last.done, self.last.total)

    def next(self, kind: Any) -> Any:
        """The next message of a kind, or of several (`A | B`). Raises RegistrationError where there
        will be none.
        """
        while True:
            self.listen_once()
            with suppress(Empty):
                message = self.said.get(timeout=LISTEN_S)
                if isinstance(message, kind):
                    return message
                if isinstance(message, Told):
                    self.last = message
                if message is None or isinstance(message, Failed):
                    raise RegistrationError(self._why(message))

    def _why(self, failed: Failed | None) -> str:
        code = self.process.wait() if failed is None else 0
        logger.warning("COLMAP ended with %d:\n%s", code, "\n".join(self.printed))
        if failed is not None:
            return failed.sentence
        if code in (-signal.SIGTERM, -9):  # there is no SIGKILL on Windows
            return (
                "the system ended the comparison of the photos, probably for lack of memory; close "
                "other programs, or use fewer photos"
            )
        return (
            f"the comparison of the photos ended unexpectedly (code {code}); try again, with fewer "
            "photos if it happens again"
        )


def _pipe(stream: IO[bytes] | None) -> IO[bytes]:
    assert stream is not None  # all three are pipes
    return stream
