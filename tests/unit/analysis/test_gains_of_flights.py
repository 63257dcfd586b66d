"""Flights that go together may be of drones with other gains, whatever their numbers are."""

from dataclasses import replace
from pathlib import Path

import made
from some import some
from tests.unit.analysis.test_bearings import START_NS, flown

from uavrt.analysis.positions import read_positions
from uavrt.localization.results import Position
from uavrt.messages import PulsePose
from uavrt.recording.places import vehicle_note

LATER_NS, LOUDER_DB = 3600 * 10**9, 10.0


def louder(one: PulsePose) -> PulsePose:
    """The pulse as another drone receives it an hour later."""
    pulse, pose = one.pulse, some(one.pose)
    pulse = replace(
        pulse,
        snr_db=some(pulse.snr_db) + LOUDER_DB,
        start_time_ns=pulse.start_time_ns + LATER_NS,
        end_time_ns=pulse.end_time_ns + LATER_NS,
    )
    return PulsePose(pulse=pulse, pose=replace(pose, time_ns=pose.time_ns + LATER_NS))


def position(directory: Path, *vehicles: int) -> Position:
    pulses = flown(threshold_db=-20.0).pulse_poses
    middle_ns = pulses[len(pulses) // 2].pulse.start_time_ns
    first = [one for one in pulses if one.pulse.start_time_ns <= middle_ns]
    second = [louder(one) for one in pulses if one.pulse.start_time_ns > middle_ns]
    flights = []
    for number, (heard, vehicle) in enumerate(zip((first, second), vehicles, strict=True)):
        info = made.flight_info(
            directory / f"{vehicles[1]}-{number}",
            (made.tag(2, 148e6, 1.25),),
            start_time_ns=START_NS,
            center_frequency_hz=148e6,
        )
        flights.append(made.flight(info, pulse_poses=heard, notes=[vehicle_note(vehicle)]))
    (found,) = read_positions(*flights)
    return some(found.position)


def test_two_drones_with_one_number_have_each_their_own_gain(tmp_path: Path) -> None:
    one_number, two_numbers = (position(tmp_path, 1, second) for second in (1, 2))
    assert one_number.stations >= 2
    assert one_number.latitude_deg == two_numbers.latitude_deg
    assert one_number.radius95_m == two_numbers.radius95_m
