"""The process that runs COLMAP: its calls block, signals abort it, and a fault of its ends no more
than this process. Started as a module; messages come on standard input and go to standard output.
"""

from __future__ import annotations

import os
import sys
import threading
import traceback
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import IO, Any

import numpy as np

from texproj.colmap.database import FeatureStore
from texproj.colmap.mapping import mapped
from texproj.colmap.messages import (
    Failed,
    Picture,
    Result,
    Task,
    Told,
    Wanted,
    receive,
    send,
)

BATCH = 24
"""Pairs that are matched between two reports: what is lost when the work is stopped. With half as
many it takes a sixth longer, since descriptors are indexed for each batch."""
WAITING = 2
"""Pictures that may wait; the others stay where they come from."""


def main() -> None:
    """Serve one task."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever COLMAP prints goes where errors go
    try:
        _serve(_inbox(sys.stdin.buffer), out)
    except MemoryError:
        send(out, Failed("not enough memory to compare the photos; close other programs"))
    except Exception as error:  # noqa: BLE001 - the parent is told, whatever it is
        traceback.print_exc()
        send(out, Failed(f"the photos could not be compared ({type(error).__name__}: {error})"))


def _inbox(stream: IO[bytes]) -> Queue[Any]:
    """What comes in. When it ends nobody waits for the result any more, and neither does this."""
    inbox: Queue[Any] = Queue(WAITING)

    def hear() -> None:
        while (message := receive(stream)) is not None:
            inbox.put(message)
        os._exit(1)

    threading.Thread(target=hear, daemon=True).start()
    return inbox


def _serve(inbox: Queue[Any], out: IO[bytes]) -> None:
    task: Task = inbox.get()
    with FeatureStore(task) as store:
        lacking = tuple(key for key in task.keys if not store.has_features(key))
        send(out, Wanted(lacking))
        _extract(store, _pictures(inbox), len(lacking), task.threads, out)
        pairs = store.chosen_pairs()
        calibrated = store.calibrated_cameras()
        fresh = [pair for pair in pairs if not store.was_matched(*pair)]
    for start in range(0, len(fresh), BATCH):
        send(out, Told("matching", start, len(fresh)))
        store.match(fresh[start : start + BATCH], Path(task.scratch) / "pairs.txt")

    def told(placed: int) -> None:
        send(out, Told("placing", placed, len(task.keys)))

    told(0)
    models = mapped(task, calibrated, told)
    with FeatureStore(task) as store:
        send(out, Result(models, *store.verified(pairs)))


def _pictures(inbox: Queue[Any]) -> Iterator[Picture]:
    while isinstance(message := inbox.get(), Picture):
        yield message


def _extract(
    store: FeatureStore, pictures: Iterator[Picture], count: int, threads: int, out: IO[bytes]
) -> None:
    """Find and keep the features of pictures as they come."""
    coming: deque[tuple[str, Future[Any]]] = deque()
    done = 0

    def finish() -> None:
        nonlocal done
        key, found = coming.popleft()
        store.save_features(key, *found.result())
        done += 1
        send(out, Told("features", done, count))

    with ThreadPoolExecutor(threads) as pool:
        for picture in pictures:
            coming.append((picture.key, pool.submit(store.features, picture)))
            if len(coming) > threads:
                finish()
        while coming:
            finish()


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
