"""Waiting for something that must happen."""

import asyncio
import time
from collections.abc import Callable
from typing import TypeVar

Found = TypeVar("Found")


def until(condition: Callable[[], Found | None], timeout_s: float = 30.0) -> Found:
    """Wait for something that must happen; the limit only ends a test that has failed."""
    deadline_s = time.monotonic() + timeout_s
    while not (found := condition()):
        assert time.monotonic() < deadline_s, "it did not happen"
        time.sleep(0.02)
    return found


async def until_async(condition: Callable[[], object], timeout_s: float = 60.0) -> None:
    """Wait in an asyncio loop; the limit only ends a test that has failed."""
    async with asyncio.timeout(timeout_s):
        while not condition():  # noqa: ASYNC110 - any condition, not one object's
            await asyncio.sleep(0.01)
