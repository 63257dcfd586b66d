"""Years on a memory card: what was promised stays, and a failing card is told."""

import contextlib
import os
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numbered
import pytest
from loop_card import LoopCard, loop_card
from tests.unit.flight.test_years import DAY_NS, SPRING_NS

from uavrt.config.settings import RecordingSettings, Settings
from uavrt.core.errors import RecordingError
from uavrt.drone.computer import computer_checks as checks
from uavrt.drone.supervisor.mission.storage.disk_guard import DiskGuard
from uavrt.flight.flight_layout import FlightLayout, new_flight_directory
from uavrt.flight.flight_order import flights_in_order
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.flight_reader import read_flight

FREE_MB = 4.0
FLIGHTS = int(os.environ.get("UAVRT_FLIGHTS", "400"))
"""On one card; ``UAVRT_FLIGHTS=1000 UAVRT_DAYS=30`` is a busy month."""
STEP_NS = round(float(os.environ.get("UAVRT_DAYS", FLIGHTS / 40)) * DAY_NS) // FLIGHTS


@pytest.fixture
def card(tmp_path: Path) -> Iterator[LoopCard]:
    yield from loop_card(tmp_path)


def test_hundreds_of_flights_on_a_small_card_lose_nothing_that_was_promised(
    card: LoopCard,
) -> None:
    """Some begin in 1970, some are starred, at times somebody fills the card to the brim."""
    rng = random.Random(1970)
    settings = RecordingSettings(
        minimum_free_mb=FREE_MB, remove_oldest_flights=True, keep_newest_flights=5
    )
    # The kernel's own time of a flight on this card would be an hour; one commit stands for it.
    flown: list[Path] = []
    starred: set[Path] = set()
    filled = refused = 0
    guard = DiskGuard(card.place, settings)
    for number in range(FLIGHTS):
        clock_ns = rng.choice((0, SPRING_NS, SPRING_NS)) + number * STEP_NS
        flight = new_flight_directory(card.place, clock_ns)
        if rng.random() < 0.04:
            filled += 1
            video = open(card.place / "holiday.mp4", "wb", buffering=0)  # noqa: SIM115
            with video, contextlib.suppress(OSError):
                while video.write(bytes(500_000)) == 500_000:
                    pass
        guard.flying(flight)
        info = replace(numbered.info(flight), tags=())
        guard.check()
        try:
            recorder = FlightRecorder.create(info, None)
        except RecordingError:  # told to the operator, and tried again
            refused += 1
            (card.place / "holiday.mp4").unlink(missing_ok=True)
            recorder = FlightRecorder.open(info, None)
        recorder.write_pulses([numbered.pulse_pose(n) for n in range(3)])
        channels = FlightLayout(flight).channels_directory
        if number % 7 == 0:
            channels.mkdir(parents=True)
            with contextlib.suppress(OSError):  # samples are what a full disk costs first
                (channels / "channel_1_Hz_0001.sigmf-data").write_bytes(bytes(120_000))
        try:
            recorder.close()
        except RecordingError:
            refused += 1
            (card.place / "holiday.mp4").unlink(missing_ok=True)
            recorder.commit()
            recorder.close()
        (card.place / "holiday.mp4").unlink(missing_ok=True)
        flown.append(flight)
        if len(starred) < 20 and rng.random() < 0.03:
            FlightLayout(flight).star.touch()
            starred.add(flight)
        guard.flying(None)
        if number % 50 == 0:  # a reboot
            guard = DiskGuard(card.place, settings)
    there = [flight for flight in flown if flight.exists()]
    assert filled > 0.02 * FLIGHTS
    assert refused > 0
    assert len(there) < 0.9 * FLIGHTS  # room had to be made
    assert flights_in_order(card.place) == there
    assert starred <= set(there)
    plain = [flight for flight in there if flight not in starred]
    assert plain == [flight for flight in flown if flight not in starred][-len(plain) :]
    assert set(flown[-5:]) <= set(there)
    for flight in there:
        assert len(read_flight(flight).pulse_poses) == 3


def test_a_card_that_turns_read_only_keeps_what_was_recorded_and_is_told(
    card: LoopCard,
) -> None:
    flight = card.place / "flight_log_2026-05-01_08-15-00"
    recorder = FlightRecorder.open(numbered.info(flight), durable=True)
    recorder.write_pulses([numbered.pulse_pose(n) for n in range(40)])
    recorder.commit()
    settings = Settings(recording=RecordingSettings(directory=str(card.place)))
    healthy = checks.check_card(settings)
    assert healthy.ok
    assert "(ext4)" in healthy.text
    card.fail()
    recorder.write_pulses([numbered.pulse_pose(n) for n in range(40, 60)])
    for _ in range(2):
        with pytest.raises(RecordingError) as caught:
            recorder.commit()
        assert caught.value.remedy
    assert recorder.waiting_records == 20
    told = checks.check_card(settings)
    assert not told.ok
    assert "the file system is read-only and records nothing more" in told.text
    assert told.remedy
    assert not checks.check_disk(settings).ok
    guard = DiskGuard(card.place, RecordingSettings(minimum_free_mb=0.0))
    guard.flying(flight)
    # The order of flights cannot be noted, which stops nothing. Each flight is told once.
    read_only = "Memory card: the file system is read-only"
    assert [text[:41] for _, text in guard.check()] == [read_only]
    assert guard.check() == []
    assert [fault.text[:41] for fault in guard.faults] == [read_only]
    guard.flying(flight)
    assert len(guard.check()) == 1
    assert len(read_flight(flight).pulse_poses) == 40
    # The card comes back with the next boot; the process has kept what it could not write.
    recorder.database.disconnect()
    card.unmount()
    card.check()
    card.mount()
    recorder.commit()
    recorder.close()
    assert len(read_flight(flight).pulse_poses) == 60
