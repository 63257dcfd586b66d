"""Wait, with a time limit, for answers that a link may lose."""

import asyncio
from collections.abc import Awaitable
from typing import TypeVar

T = TypeVar("T")


async def within(timeout_s: float, answer: Awaitable[T]) -> T | None:
    """Wait for an answer; None if no answer arrives within `timeout_s`."""
    try:
        async with asyncio.timeout(timeout_s):
            return await answer
    except TimeoutError:
        return None
