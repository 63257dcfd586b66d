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


def test_flights_that_count_each_sample_fly_beside_no_other_of_their_kind() -> None:
    assert kind_of(FLIGHTS / "test_recovery.py") is Kind.FLIGHT
    assert sum(Kind.FLIGHT in order for order in ORDERS) == 1
    assert kind_of(FLIGHTS / "test_fly.py") is Kind.BESIDE
    assert kind_of(ROOT / "tests/unit/experiments/test_packets.py") is Kind.BESIDE
    assert kind_of(FLIGHTS / "test_install.py") is Kind.COMPUTES
    assert kind_of(ROOT / BROWSERS) is Kind.BROWSER


@pytest.mark.parametrize("begins", [*workers._FOR_ITSELF, *workers._ON_FILES, workers._DEMO])
def test_every_flight_that_is_named_is_there(begins: str) -> None:
    assert list(FLIGHTS.glob(f"{begins.removesuffix('.py')}*.py"))
