"""A memory card that turns read-only in flight costs the record, and no pulse."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest
from listening import Listening
from loop_card import LoopCard, loop_card

from uavrt.flight.reading.flight_reader import read_flight

pytestmark = pytest.mark.timeout(240)


@pytest.fixture
def card(tmp_path: Path) -> Iterator[LoopCard]:
    yield from loop_card(tmp_path)


def statuses(drone: Any) -> Iterator[dict[str, Any]]:
    """The processes as they are now, again and again."""
    for _ in range(300):
        for topic, record in drone.status.read(0.2):
            if topic == "system_status":
                yield {process.process: process for process in record.processes}
    raise AssertionError("never came")


def test_pulses_go_on_to_the_ground_and_the_operator_is_told(
    drone_bay: Any, thesis_scenario: Any, card: LoopCard
) -> None:
    def on_card(recording: Any) -> Any:
        return replace(recording, directory=str(card.place), minimum_free_mb=1.0)

    tags = msgspec.json.encode(thesis_scenario.tags).decode()
    drone = drone_bay.launch(thesis_scenario, tags, recording=on_card)
    ground = Listening(drone)
    ground.listen(lambda: len(ground.pulses) >= 2)
    next(s for s in statuses(drone) if s["recorder"].counters.get("pulses_recorded", 0) >= 3)
    card.fail()
    ground.listen(
        lambda: len(ground.pulses) >= 5,
        lambda: any("the file system is read-only" in text for text in ground.texts),
        lambda: any("cannot write the flight" in text for text in ground.texts),
    )
    now = next(s for s in statuses(drone) if s["recorder"].status == "cannot write the flight")
    assert not now["recorder"].ok
    assert [name for name, process in now.items() if process.restarts] == []
    drone.supervisor.stop()
    assert drone.supervisor.exit_code == 0

    # The card stays read-only, as one at its end does: the next start finds it so.
    card.unmount()
    card.check()
    card.mount("ro")
    next_day = drone_bay.launch(thesis_scenario, tags, recording=on_card)
    ground = Listening(next_day)
    ground.listen(
        lambda: len(ground.pulses) >= 3,
        lambda: any("cannot write the flight" in text for text in ground.texts),
    )
    next_day.supervisor.stop()
    assert next_day.supervisor.exit_code == 0

    card.unmount()
    card.check()
    card.mount()
    (flight,) = card.place.glob("flight_log_*")
    assert len(read_flight(flight).pulse_poses) >= 3
