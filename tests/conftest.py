"""Settings and fixtures of all tests: the processor's kernels, and a ROS 2 network."""

import asyncio
import gc
import inspect
import os
import platform
import random
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path
from typing import Any

import pytest
from depth import count
from hypothesis import HealthCheck, settings
from ros_peer import GatewayProcess, RosPeer

from uavrt.config.settings import Ros2Settings, Settings
from uavrt.core.messages import FlightInfo
from uavrt.core.runtime import native
from uavrt.simulation.demo import demo_programs

# The same examples in each run; `make claims` sets UAVRT_NEW_EXAMPLES: others, and more.
# An example is not wrong because a shared machine is late.
settings.register_profile(
    "here",
    settings(
        max_examples=count(40, 100),
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow],
        derandomize="UAVRT_NEW_EXAMPLES" not in os.environ,
    ),
)
settings.load_profile("here")

# A shell starts background programs with Ctrl-C ignored. Many programs that the tests start
# must end by it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

FLIGHTS = Path(__file__).parent / "flight"
PORT_SHARES = 16
"""Shares of the UDP ports: eight for workers in virtual time, eight for those in real time."""
MOST_SECOND_TRIES = 3
"""Flights in real time that may need a second try before the run fails."""


def pytest_configure(config: pytest.Config) -> None:
    """Give each worker UDP ports of its own: two could take one that neither has bound yet."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw7").removeprefix("gw")) % 8
    share = worker + 8 * any("tests/unit" in one for one in config.args)
    ports = demo_programs.PORTS[share::PORT_SHARES]
    demo_programs._ports = cycle(random.SystemRandom().sample(ports, len(ports)))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give flights in real time a second try, and start slow files first.

    A shared machine that stands still for seconds breaks the silence limits that flights are
    there to test. The summary names each flight that needed it. Files with slow tests come
    first: one at the end of a run would leave the other worker idle.
    """
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
    for item in items:
        if FLIGHTS in item.path.parents:
            item.add_marker(pytest.mark.flaky(reruns=1))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Show why the first try of a test failed, which passed or failed in the second."""
    for report in terminalreporter.stats.get("rerun", []):
        terminalreporter.section(f"first try of {report.nodeid}", sep="-")
        report.toterminal(terminalreporter._tw)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run in which more than three flights needed a second try."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    tries = reporter.stats.get("rerun", []) if reporter else []
    if reporter and len(tries) > MOST_SECOND_TRIES and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
        reporter.write_line(f"{len(tries)} flights needed a second try", red=True)


def pytest_collection_finish() -> None:
    """Leave tests and modules, which stay to the end, out of each search for garbage."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Run a test that is a coroutine in a loop of its own."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    given = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}
    asyncio.run(pyfuncitem.obj(**given))
    return True


@pytest.fixture(params=["plain", "avx2", "avx512"])
def processor(request: pytest.FixtureRequest) -> Iterator[str]:
    """Let the compiled kernels take the loops for a processor, if this one can run them."""
    kernels = native.kernels()
    if kernels is None:
        pytest.skip(f"{native.description()}: python hatch_build.py kernels")
    taken = kernels.choose(request.param)
    try:
        if taken != request.param:
            pytest.skip(f"this processor has no {request.param}")
        yield taken
    finally:
        kernels.choose("avx512")


@pytest.fixture
def ran(capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Run `uavrt` in this process; what it printed."""
    from command_line import Printed, uavrt

    def run(*arguments: object, ends: int = 0) -> Printed:
        capsys.readouterr()
        status = uavrt(*map(str, arguments))
        printed = Printed(*capsys.readouterr())
        assert status == ends, printed.err
        return printed

    return run


@pytest.fixture
def ros_domain() -> int:
    """A ROS domain that nobody on this computer uses now."""
    for attempt in range(100):
        domain_id = 1 + (os.getpid() * 7 + attempt) % 100
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            try:
                # Unicast discovery port of the domain's first participant (DDSI-RTPS §9.6.1).
                sock.bind(("127.0.0.1", 7400 + 250 * domain_id + 10))
            except OSError:
                continue
            return domain_id
    raise AssertionError("no ROS domain is free")


@pytest.fixture
def ros_peer(ros_domain: int) -> Iterator[RosPeer]:
    """Another participant in `ros_domain`."""
    if not (sys.platform == "linux" and platform.machine() == "x86_64"):
        pytest.importorskip("cyclonedds", reason="no wheel for this computer")
    peer = RosPeer(ros_domain)
    yield peer
    peer.close()


Launch = Callable[..., GatewayProcess]


@pytest.fixture
def launch(ros_domain: int) -> Iterator[Launch]:
    """Start gateways in the test's domain; ends them all."""
    started: list[GatewayProcess] = []

    def start(
        ros2: Ros2Settings | None = None,
        flight: FlightInfo | None = None,
        prefix: tuple[str, ...] = (),
        **environment: str,
    ) -> GatewayProcess:
        settings = Settings(ros2=ros2 or Ros2Settings(enabled=True, domain_id=ros_domain))
        started.append(GatewayProcess(settings, flight, prefix, **environment))
        return started[-1]

    yield start
    for gateway in started:
        gateway.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, for the tests of the page."""
    from page_driver import chromium

    with chromium() as running:
        yield running


@pytest.fixture
def scene(tmp_path: Path, browser: Any) -> Iterator[Any]:
    """A ground station with its pages, and drones; it starts when it is asked for."""
    from page_driver import Scene

    made = Scene(tmp_path, browser)
    yield made
    made.close()
