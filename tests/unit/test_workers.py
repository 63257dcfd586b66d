"""Who runs which test: no file is left over, and none flies where it would lose samples."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import workers
from workers import BROWSERS, ORDERS, Kind, kind_of

ROOT = Path(__file__).parents[2]
FLIGHTS = ROOT / "tests/flight"


def test_the_first_worker_takes_all_kinds_as_it_may_be_the_only_one() -> None:
    assert set(ORDERS[0]) == set(Kind)
    assert ORDERS[-1] == (Kind.COMPUTES,)


def test_the_demo_flies_when_the_browsers_are_done() -> None:
    assert kind_of(FLIGHTS / "test_demo.py") is Kind.DEMO
    first = ORDERS[0]
    assert first.index(Kind.DEMO) > first.index(Kind.BROWSER)
    assert not any(Kind.DEMO in order for order in ORDERS[1:])


def test_flights_fly_one_at_a_time_and_installations_are_none() -> None:
    assert sum(Kind.FLIGHT in order for order in ORDERS) == 1
    for name in (
        "flight/test_recovery.py",
        "flight/test_fly.py",
        "unit/experiments/test_packets.py",
    ):
        assert kind_of(ROOT / "tests" / name) is Kind.FLIGHT
    assert kind_of(FLIGHTS / "test_install.py") is Kind.COMPUTES
    assert kind_of(ROOT / BROWSERS) is Kind.BROWSER


@pytest.mark.parametrize("begins", [*workers._ON_FILES, workers._DEMO])
def test_every_flight_that_is_named_is_there(begins: str) -> None:
    assert list(FLIGHTS.glob(f"{begins.removesuffix('.py')}*.py"))


_SHARED = """
from workers import ByNeed


def pytest_xdist_make_scheduler(config, log):
    return ByNeed(config, log)
"""
_DIES = """
import os


def test_it_dies():
    os._exit(9)
"""
_COUNTS = """
import time

import pytest


@pytest.mark.parametrize("number", range(4))
def test_it_counts(number):
    time.sleep(0.02)
"""


@pytest.mark.parametrize("dies_in", ["tests/flight", "tests/flight/browser", "tests/unit"])
@pytest.mark.timeout(120)
def test_a_worker_that_dies_takes_one_test_with_it_and_the_run_ends(
    tmp_path: Path, dies_in: str
) -> None:
    (tmp_path / "conftest.py").write_text(_SHARED)
    for folder in ("tests/flight", "tests/flight/browser", "tests/unit"):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        for number in range(4):
            name = f"test_{folder.replace('/', '_')}_{number}.py"
            (tmp_path / folder / name).write_text(_COUNTS)
    (tmp_path / dies_in / "test_x_last.py").write_text(_DIES)
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n", "3", "--rootdir", str(tmp_path), "tests"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT / "tests" / "drivers")},
        timeout=100,
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 1
    assert "1 failed, 48 passed" in ran.stdout
