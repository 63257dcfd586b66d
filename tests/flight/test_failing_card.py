"""A memory card that turns read-only in flight costs the record, and no pulse."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from listening import Listening
from loop_card import LoopCard, loop_card
from tests.flight.conftest import process

from uavrt.flight.reading.flight_reader import read_flight

pytestmark = pytest.mark.timeout(240)


@pytest.fixture
def card(tmp_path: Path) -> Iterator[LoopCard]:
    yield from loop_card(tmp_path)


def test_pulses_go_on_to_the_ground_and_the_operator_is_told(
    drone_bay: Any, thesis_scenario: Any, card: LoopCard
) -> None:
    def on_card(recording: Any) -> Any:
        return replace(recording, directory=str(card.place), minimum_free_mb=1.0)

    tags = thesis_scenario.tags
    drone = drone_bay.launch(thesis_scenario, tags=tags, recording=on_card)
    ground = Listening(drone)
    ground.listen(lambda: len(ground.pulses) >= 2)
    drone.status_when(
        lambda one: process(one, "recorder").counters.get("pulses_recorded", 0) >= 3
    )
    card.fail()
    ground.listen(
        lambda: len(ground.pulses) >= 5,
        lambda: any("the file system is read-only" in text for text in ground.texts),
        lambda: any("cannot write the flight" in text for text in ground.texts),
    )
    now = drone.status_when(
        lambda one: process(one, "recorder").status == "cannot write the flight"
    )
    assert not process(now, "recorder").ok
    assert [one for one in now.processes if one.restarts] == []
    drone.end()

    # The card stays read-only, as one at its end does: the next start finds it so.
    card.unmount()
    card.check()
    card.mount("ro")
    next_day = drone_bay.launch(thesis_scenario, tags=tags, recording=on_card)
    ground = Listening(next_day)
    ground.listen(
        lambda: len(ground.pulses) >= 3,
        lambda: any("cannot write the flight" in text for text in ground.texts),
    )
    next_day.end()

    card.unmount()
    card.check()
    card.mount()
    (flight,) = card.place.glob("flight_log_*")
    assert len(read_flight(flight).pulse_poses) >= 3
