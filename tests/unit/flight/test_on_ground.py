"""A flight knows when its vehicle stood on the ground, as far as the autopilot told."""

from pathlib import Path

import made
from hypothesis import given
from hypothesis import strategies as st

from uavrt.config.settings import Settings
from uavrt.core.earth.on_ground import EVER_NS, spans_on_ground
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.flight_reader import read_flight

START_NS = 1_700_000_000 * 10**9
SECOND = 10**9
States = list[tuple[int, bool]]


def recorded(tmp_path: Path, counters: list[dict[str, float]]) -> tuple[tuple[int, int], ...]:
    """What a flight tells whose connection said so, once a second."""
    info = made.flight_info(tmp_path / "flight", start_time_ns=START_NS)
    recorder = FlightRecorder.create(info, Settings())
    for number, one in enumerate(counters):
        at_ns = START_NS + number * SECOND
        recorder.write(made.health("connection", at_ns, counters=one))
    recorder.close()
    return read_flight(info.directory).on_ground_ns


def test_a_flight_tells_when_it_stood_on_the_ground(tmp_path: Path) -> None:
    counters = [
        {"autopilot_armed": float(2 <= n < 9), "autopilot_landed": float(not 4 <= n < 7)}
        for n in range(12)
    ]
    first, last = recorded(tmp_path, counters)
    assert first == (START_NS, START_NS + 4 * SECOND - 1)
    assert last == (START_NS + 7 * SECOND, EVER_NS)


def test_a_flight_that_tells_arming_alone_stands_while_disarmed(tmp_path: Path) -> None:
    counters = [{"autopilot_armed": float(n >= 3)} for n in range(6)]
    assert recorded(tmp_path, counters) == ((START_NS, START_NS + 3 * SECOND - 1),)


def test_an_older_flight_or_one_without_an_autopilot_tells_nothing(tmp_path: Path) -> None:
    assert recorded(tmp_path, [{"pulses_sent": 1.0}, {}]) == ()


STATES = st.lists(st.tuples(st.integers(0, 99), st.booleans()), max_size=20)


@given(STATES, STATES)
def test_spans_are_in_order_and_none_where_nothing_flew(armed: States, landed: States) -> None:
    spans = spans_on_ground(armed, landed)
    edges = [time for span in spans for time in span]
    assert edges == sorted(edges)
    if not any(state for _, state in armed) and all(state for _, state in landed):
        assert spans == ()
