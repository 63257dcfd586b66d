"""Tests that only compute: no program is started, and a wait costs no time.

`asyncio.run` runs in virtual time here. What needs a program, a thread that waits, a pseudo
terminal or real TCP belongs to `tests/system`, as does the test of this guard.
"""

import sys
import time
from collections.abc import Iterator
from multiprocessing.process import BaseProcess

import pytest
from virtual_time import VirtualClock, virtual_time

REFUSED = {
    "os.fork",
    "os.forkpty",
    "os.posix_spawn",
    "os.system",
    "subprocess.Popen",
    "time.sleep",
    "multiprocessing.Process.start",
}
"""Audit events of the interpreter that end a test of this folder."""

_running: list[str] = []
"""The test that runs now; a hook of the interpreter cannot be removed again."""


def _refuse(event: str, arguments: tuple[object, ...]) -> None:
    if _running and event in REFUSED:
        # No `except Exception` of the product may hide it.
        pytest.fail(f"{event}{arguments} in {_running[-1]}: it belongs to tests/system")


sys.addaudithook(_refuse)


@pytest.fixture(autouse=True)
def nothing_waits(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Refuse real waiting and the starting of programs while a test runs."""

    def sleep(seconds: float) -> None:
        _refuse("time.sleep", (seconds,))

    def start(process: BaseProcess) -> None:
        _refuse("multiprocessing.Process.start", (process.name,))

    _running.append(request.node.nodeid)
    monkeypatch.setattr(time, "sleep", sleep)
    monkeypatch.setattr(BaseProcess, "start", start)
    yield
    _running.pop()


@pytest.fixture(autouse=True)
def clock_of_test() -> Iterator[VirtualClock]:
    """Run the test on a virtual clock."""
    with virtual_time() as virtual:
        yield virtual
