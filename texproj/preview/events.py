"""News from the server to every open page, as server-sent events."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Any

HEARTBEAT_S = 5.0
"""A line this often lets the page notice a dead connection, and the server a closed page."""

QUEUE_LENGTH = 256
"""A page that reads slower than this many events is told to load everything again."""


class Hub:
    """Sends each event to all pages that listen. Events may come from any thread."""

    def __init__(self) -> None:
        self._queues: set[asyncio.Queue[bytes]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._closed = False

    @property
    def listeners(self) -> int:
        return len(self._queues)

    def send(self, kind: str, data: dict[str, Any]) -> None:
        """Tell all pages; nobody listening is fine."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._deliver, encode(kind, data))

    def close(self) -> None:
        """End all streams, so that the server can stop."""
        self._closed = True
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._deliver, b"")

    def _deliver(self, event: bytes) -> None:
        for queue in self._queues:
            if queue.full():
                while not queue.empty():
                    queue.get_nowait()
                queue.put_nowait(encode("reload", {}))
            queue.put_nowait(event)

    async def stream(self, hello: dict[str, Any]) -> AsyncIterator[bytes]:
        """The events from now on, as bytes of an event stream; `hello` comes first."""
        self._loop = asyncio.get_running_loop()
        queue: asyncio.Queue[bytes] = asyncio.Queue(QUEUE_LENGTH)
        self._queues.add(queue)
        try:
            yield encode("hello", hello)
            while not self._closed:
                try:
                    event = await asyncio.wait_for(queue.get(), HEARTBEAT_S)
                except TimeoutError:
                    event = encode("alive", {})
                if event:
                    yield event
        finally:
            self._queues.discard(queue)


def encode(kind: str, data: dict[str, Any]) -> bytes:
    """One event in the text/event-stream format."""
    return f"event: {kind}\ndata: {json.dumps(data, separators=(',', ':'))}\n\n".encode()
