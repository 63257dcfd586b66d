"""Send records to all connected browsers, with a bounded queue for each."""

import asyncio
from typing import Any

import msgspec

QUEUE = 4000
"""Maximum number of records queued for a slow browser: 80 s at 50 records a second. When the
queue is full, the browser must reload the page."""


class Hub:
    """Sends each record, encoded once, to every connected browser."""

    def __init__(self) -> None:
        self._listeners: set[asyncio.Queue[str | None]] = set()

    def listen(self) -> asyncio.Queue[str | None]:
        """Add a browser's queue of JSON texts.

        A None in the queue means that the browser must reload the page, or that the server
        stops.
        """
        queue: asyncio.Queue[str | None] = asyncio.Queue(QUEUE)
        self._listeners.add(queue)
        return queue

    def leave(self, queue: asyncio.Queue[str | None]) -> None:
        """Remove the queue of a browser that has disconnected."""
        self._listeners.discard(queue)

    def send(self, topic: str, record: Any) -> None:
        """Send a record to all browsers; non-finite numbers become null."""
        if not self._listeners:
            return
        text = encode({"topic": topic, "record": record}).decode()
        for queue in list(self._listeners):
            try:
                queue.put_nowait(text)
            except asyncio.QueueFull:
                self._end(queue)

    def close(self) -> None:
        """Close the queues of all browsers."""
        for queue in list(self._listeners):
            self._end(queue)

    def _end(self, queue: asyncio.Queue[str | None]) -> None:
        self._listeners.discard(queue)
        while not queue.empty():
            queue.get_nowait()
        queue.put_nowait(None)


def encode(value: Any) -> bytes:
    """Encode as JSON; NaN and infinity become null."""
    return msgspec.json.encode(value)
