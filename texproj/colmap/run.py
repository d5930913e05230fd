"""Running COLMAP's process: it is fed, listened to, and ended whenever somebody asks for it."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from queue import Empty, Queue
from typing import Any

from texproj.colmap.messages import Failed, Picture, Result, Task, Told, Wanted, receive, send
from texproj.errors import RegistrationError

LISTEN_S = 0.25
"""Seconds between two chances to stop the work."""
SENTENCE_OF_A_KILL = (
    "the process that compares the photos ended without a word (out of memory? exit code {code}); "
    "close other programs, or use fewer or smaller photos"
)

Listen = Callable[[str, int, int], None]
"""``listen(what, done, total)``, several times a second; it may raise to stop the work."""


def available() -> bool:
    """Whether COLMAP is installed here."""
    return find_spec("pycolmap") is not None


@contextmanager
def _process() -> Iterator[subprocess.Popen[bytes]]:
    """COLMAP's process; it ends with the block, whatever happens in it."""
    command = [sys.executable, "-m", "texproj.colmap.process"]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        start_new_session=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):  # what the process did not take any more
                    stream.close()


def run_colmap(
    task: Task, pictures: Callable[[Sequence[str]], Iterator[Picture]], listen: Listen
) -> Result:
    """What COLMAP makes of the photos of a task. pictures: makes those of the keys that it lacks.

    Raises RegistrationError where it cannot go on, and whatever `listen` raises.
    """
    with _process() as process:
        said: Queue[Any] = Queue()
        threading.Thread(target=_hear, args=(process.stdout, said), daemon=True).start()
        last = Told("features", 0, len(task.keys))
        try:
            send(process.stdin, task)  # type: ignore[arg-type]
            wanted = _next(said, process, listen, last)
            for picture in pictures(wanted.keys):
                send(process.stdin, picture)  # type: ignore[arg-type]
                listen(last.what, last.done, last.total)
            process.stdin.close()  # type: ignore[union-attr]
        except BrokenPipeError:
            pass  # what is heard tells why
        while not isinstance(message := _next(said, process, listen, last), Result):
            last = message
    return message


def _hear(stream: Any, said: Queue[Any]) -> None:
    """Every message; None at the end."""
    while (message := receive(stream)) is not None:
        said.put(message)
    said.put(None)


def _next(said: Queue[Any], process: subprocess.Popen[bytes], listen: Listen, last: Told) -> Any:
    """The next message. Raises RegistrationError where the process cannot go on."""
    while True:
        listen(last.what, last.done, last.total)
        try:
            message = said.get(timeout=LISTEN_S)
        except Empty:
            continue
        if message is None:
            raise RegistrationError(SENTENCE_OF_A_KILL.format(code=process.wait()))
        if isinstance(message, Failed):
            raise RegistrationError(f"the photos could not be compared: {message.sentence}")
        if isinstance(message, Told | Wanted | Result):
            return message
