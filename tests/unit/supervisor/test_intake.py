"""Records are read at once after a silence, and together when there is much."""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from functools import partial

import pytest
from until import until_async as until

from uavrt.drone.supervisor.tree.child_records import Intake

LONG_S = 3600.0
"""A period that does not end while a test runs."""


class Sources:
    """Sockets with an intake, and what was read of them."""

    def __init__(self, intake: Intake, count: int) -> None:
        self.intake = intake
        self.pairs = [socket.socketpair() for _ in range(count)]
        self.got: list[tuple[int, bytes]] = []
        for number, (_, theirs) in enumerate(self.pairs):
            intake.add(theirs.fileno(), partial(self._read, number))

    def _read(self, number: int) -> None:
        self.got.append((number, self.pairs[number][1].recv(4096)))

    def say(self, number: int, text: bytes) -> None:
        self.pairs[number][0].sendall(text)

    async def until(self, count: int) -> None:
        await until(lambda: len(self.got) >= count)

    def close(self) -> None:
        for ours, theirs in self.pairs:
            self.intake.remove(theirs.fileno())
            ours.close()
            theirs.close()


@contextlib.asynccontextmanager
async def sources_of(period_s: float, count: int) -> AsyncIterator[Sources]:
    sources = Sources(Intake(period_s), count)
    try:
        yield sources
    finally:
        sources.close()


async def test_what_comes_after_a_silence_is_read_at_once_and_the_next_waits() -> None:
    async with sources_of(LONG_S, 2) as sources:
        sources.say(0, b"command")
        await sources.until(1)
        sources.say(1, b"pulse")
        for _ in range(20):
            await asyncio.sleep(0.001)
        assert sources.got == [(0, b"command")]


async def test_all_that_came_within_a_period_is_read_together_and_nothing_is_lost() -> None:
    async with sources_of(0.02, 3) as sources:
        sources.say(0, b"first")
        await sources.until(1)
        for part in (b"a", b"b", b"c"):
            sources.say(1, part)
            sources.say(2, part * 2)
        await sources.until(3)
        assert sources.got[0] == (0, b"first")
        assert sorted(sources.got[1:]) == [(1, b"abc"), (2, b"aabbcc")]
        # It listens again: after a silence and for a busy while alike.
        for number in range(10):
            sources.say(number % 3, b"more")
            await sources.until(4 + number)


async def test_a_reader_that_is_removed_by_another_is_not_called() -> None:
    async with sources_of(LONG_S, 2) as sources:
        intake, (_, first), (_, second) = sources.intake, *sources.pairs
        called: list[int] = []

        def end_the_other(number: int, other: socket.socket) -> None:
            called.append(number)
            intake.remove(other.fileno())

        for number, (own, other) in enumerate(((first, second), (second, first))):
            intake.remove(own.fileno())
            intake.add(own.fileno(), partial(end_the_other, number, other))
        sources.say(0, b"x")
        sources.say(1, b"x")
        await until(lambda: called)
        await asyncio.sleep(0.02)
        assert len(set(called)) == 1


async def test_a_reader_that_fails_does_not_make_the_others_deaf() -> None:
    async with sources_of(0.01, 1) as sources:
        faults: list[object] = []
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, context: faults.append(context["exception"]))
        ours, theirs = socket.socketpair()

        def fail() -> None:
            theirs.recv(1)
            raise ZeroDivisionError

        sources.intake.add(theirs.fileno(), fail)
        ours.sendall(b"x")
        await until(lambda: faults)
        sources.say(0, b"still heard")
        await sources.until(1)
        assert [type(fault) for fault in faults] == [ZeroDivisionError]
        sources.intake.remove(theirs.fileno())
        ours.close()
        theirs.close()


@pytest.mark.parametrize("busy", [False, True], ids=["after a silence", "while busy"])
async def test_an_intake_without_sources_leaves_nothing_in_the_event_loop(busy: bool) -> None:
    sources = Sources(Intake(0.01), 2)
    if busy:
        sources.say(0, b"x")
        await sources.until(1)
    sources.close()
    # Descriptors are used again: a new source under an old number is heard.
    again = Sources(sources.intake, 2)
    again.say(1, b"y")
    await again.until(1)
    assert again.got == [(1, b"y")]
    again.close()
