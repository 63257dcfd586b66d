"""Tests that only compute: no program is started, and a wait costs no time.

`asyncio.run` runs in virtual time here. What needs a program, a thread that waits, a pseudo
terminal or real TCP belongs to `tests/system`, as does the test of this guard.
"""

import contextlib
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
"""Tests and fixtures that run now; the hook below cannot be removed from the interpreter."""


def _refuse(event: str, arguments: tuple[object, ...]) -> None:
    if _running and event in REFUSED:
        # No `except Exception` of the product may hide it.
        pytest.fail(f"{event}{arguments} in {_running[-1]}: it belongs to tests/system")


sys.addaudithook(_refuse)


@contextlib.contextmanager
def _guarded(name: str) -> Iterator[VirtualClock]:
    """Refuse real waiting and the starting of programs; the clock is a virtual one."""

    def sleep(seconds: float) -> None:
        _refuse("time.sleep", (seconds,))

    def start(process: BaseProcess) -> None:
        _refuse("multiprocessing.Process.start", (process.name,))

    with pytest.MonkeyPatch.context() as patch, virtual_time() as virtual:
        patch.setattr(time, "sleep", sleep)
        patch.setattr(BaseProcess, "start", start)
        _running.append(name)
        try:
            yield virtual
        finally:
            _running.pop()


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(
    fixturedef: pytest.FixtureDef[object], request: pytest.FixtureRequest
) -> Iterator[None]:
    """Guard fixtures of a module or class, which run outside of tests."""
    if request.scope == "function":
        return (yield)
    with _guarded(f"{fixturedef.argname} of {request.node.nodeid}"):
        return (yield)


@pytest.fixture(autouse=True)
def clock_of_test(request: pytest.FixtureRequest) -> Iterator[VirtualClock]:
    """Run the test on a virtual clock."""
    with _guarded(request.node.nodeid) as virtual:
        yield virtual
