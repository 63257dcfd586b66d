"""Who runs which test: flights one at a time, browsers one at a time, the rest behind them.

A flight at 3 MS/s with its simulated radio and vehicle takes a whole core, as does a browser
that draws a map without a graphics processor. Two flights at once on two cores lose samples,
truly. So the first worker takes flights, the second browsers and what talks over sockets. What
only computes fills the processors at the lowest priority, and who has no more of its own helps
out with that.
"""

import os
import re
from enum import StrEnum
from functools import cache
from pathlib import Path

from xdist.scheduler import LoadFileScheduling
from xdist.workermanage import WorkerController

FLIGHTS = "tests/flight/"
BROWSERS = "tests/flight/browser/"
"""Folder whose tests need a browser; one unit of work."""
REAL_TIME = {"flight", "ground", "mavlink", "processes", "ros2", "supervisor"}
"""Folders whose tests talk over sockets against the clock."""
_SPEAKS = re.compile(
    r"^(?:import|from) (?:asyncio|subprocess|socket|multiprocessing|threading)\b", re.M
)
"""How such a test is recognized elsewhere."""
_FLIES = re.compile(r"^@pytest\.mark\.flight\b", re.M)
"""How a flight is recognized elsewhere."""
_ON_FILES = ("test_install", "test_detect_bad_input", "test_detect_flight", "test_arm64")
"""Files among the flights whose tests do not run against the clock, by how they begin."""
_DEMO = "test_demo.py"
"""It loses samples beside a browser."""
_HELPERS_NICENESS = 19
"""A hundredth of the others' share of a busy core: a flight has all it needs."""


class Kind(StrEnum):
    """What a file's tests need."""

    FLIGHT = "flight"
    DEMO = "demo"
    BROWSER = "browser"
    REAL_TIME = "real time"
    COMPUTES = "computes"


@cache
def kind_of(path: Path) -> Kind:
    """Tell what the tests of a file, or of a folder of browsers, need."""
    name = f"{path.as_posix()}/"
    if BROWSERS in name:
        return Kind.BROWSER
    if FLIGHTS in name:
        if path.name.startswith(_ON_FILES):
            return Kind.COMPUTES
        if path.name == _DEMO:
            return Kind.DEMO
        return Kind.FLIGHT
    text = path.read_text("utf-8") if path.is_file() else ""
    if _FLIES.search(text):
        return Kind.FLIGHT
    if _SPEAKS.search(text):
        return Kind.REAL_TIME
    return Kind.REAL_TIME if REAL_TIME & set(path.parts) else Kind.COMPUTES


ORDERS = (
    (Kind.FLIGHT, Kind.BROWSER, Kind.REAL_TIME, Kind.DEMO, Kind.COMPUTES),
    (Kind.BROWSER, Kind.REAL_TIME, Kind.COMPUTES),
    (Kind.COMPUTES,),
)
"""What each worker takes, the first that is left; the last one's is that of all others.

The first takes all there is: it may be the only one. The demo comes when browsers are done.
"""


@cache
def step_back() -> None:
    """Leave the processor to other workers, once: who computes runs no flight any more."""
    os.nice(_HELPERS_NICENESS)


class ByNeed(LoadFileScheduling):  # type: ignore[misc]  # it has no types
    """Share tests out by files, and all browsers to one worker."""

    def _split_scope(self, nodeid: str) -> str:
        scope: str = super()._split_scope(nodeid)
        return BROWSERS if scope.startswith(BROWSERS) else scope

    def remove_node(self, node: WorkerController) -> str | None:
        """Hand on what a worker leaves that died, but for the test that it died of.

        The original hands on that test, too, which ends one worker after the other, and tests
        that are done: whoever gets these waits forever for their results.
        """
        left = self.assigned_work.pop(node)
        open_tests = [
            (scope, test) for scope, tests in left.items() for test in tests if not tests[test]
        ]
        if not open_tests:
            return None
        scope, died_of = open_tests[0]
        left[scope][died_of] = True
        self.workqueue.update(
            {scope: tests for scope, tests in left.items() if not all(tests.values())}
        )
        for other in self.assigned_work:
            self._reschedule(other)
        return str(died_of)

    def _assign_work_unit(self, node: WorkerController) -> None:
        # What is left must find someone who takes it: only workers that go on are counted.
        at_work = [one for one in self.nodes if one is node or not one.shutting_down]
        number = at_work.index(node)
        kinds = {scope: kind_of(self.config.rootpath / scope) for scope in self.workqueue}
        for wanted in ORDERS[min(number, len(ORDERS) - 1)]:
            scope = next((one for one, kind in kinds.items() if kind is wanted), None)
            if scope is not None:
                self.workqueue.move_to_end(scope, last=False)
                super()._assign_work_unit(node)
                return
        node.shutdown()
