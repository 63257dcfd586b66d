"""Who runs which test: no file is left over, and none flies where it would lose samples."""

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
