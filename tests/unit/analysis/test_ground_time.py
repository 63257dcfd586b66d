"""Standing, climbing and carrying are no turns, whatever a log tells of heights."""

import math
from collections.abc import Callable
from pathlib import Path

import made
import numpy as np
import pytest
from file_bearings import read_bearings
from tests.unit.analysis.test_tags_of_several_logs import as_log

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import PulsePose
from uavrt.flight.logs.pulse_pose_log import format_line
from uavrt.formats.pulses.tagtracker import write_tagtracker
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import PATTERNS

PLANE = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
START_NS = 1_700_000_000 * 10**9
TAG = (150.0, 420.0)
STAND_S = 150.0
TURN_S = 60.0
Pulses = list[PulsePose]


def heard(*, turns: int = 1) -> Pulses:
    """Pulses of a flight over one place that stands, climbs, turns, lands and is carried.

    On the ground the tag is strongest 90° beside its direction: bodies and reflections.
    """
    steps = [(STAND_S, 0.0, 0.0, 9.0), (20.0, 0.0, 40.0, 0.0)]
    for number in range(turns):
        turned = (-1.0) ** number * 360.0
        steps += [(5.0, 0.0, 0.0, 0.0), (TURN_S, 0.0, 0.0, turned), (5.0, 0.0, 0.0, 0.0)]
    steps += [(25.0, 0.0, -40.0, 0.0), (5.0, 0.0, 0.0, 0.0), (40.0, 3.0, 0.0, 320.0)]
    seconds, east, height, yaw = np.cumsum([(0.0, 0.0, 0.0, 10.0), *steps], axis=0).T
    rng = np.random.default_rng(1)
    found = []
    for number, time in enumerate(np.arange(0.4, seconds[-1], 1.25)):
        e, h, y = (float(np.interp(time, seconds, one)) for one in (east, height, yaw))
        towards = math.degrees(math.atan2(TAG[0] - e, TAG[1])) - y + (90.0 if h < 2.0 else 0.0)
        gain = float(PATTERNS["RA-23K"].gain_db([towards])[0])
        latitude, longitude = PLANE.to_geodetic(e, 0.0)
        time_ns = START_NS + round(time * 1e9)
        pose = made.pose(
            time_ns,
            latitude,
            longitude,
            altitude_relative_m=h + float(rng.normal(0.0, 0.1)),
            altitude_amsl_m=500.0 + h + float(rng.normal(0.0, 0.1)),
            yaw_deg=y,
        )
        pulse = made.pulse(
            time_ns,
            frequency_hz=148e6,
            snr_db=24.0 + gain + float(rng.normal(0.0, 1.0)),
            group_sequence=number,
            noise_psd=1e-10,
        )
        found.append(PulsePose(pulse=pulse, pose=pose))
    return found


def as_tagtracker(path: Path, pulses: Pulses) -> None:
    with path.open("w", encoding="utf-8") as stream:
        write_tagtracker(stream, pulses)


def as_pulse_pose_log(path: Path, pulses: Pulses) -> None:
    path.write_text("".join(format_line(one) for one in pulses), encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("log.jsonl", as_log),
        ("log.csv", as_tagtracker),
        ("pulse_pose_log.txt", as_pulse_pose_log),  # has heights above sea level alone
    ],
)
@pytest.mark.parametrize("turns", [1, 2])
def test_a_log_of_one_place_with_ground_climb_and_carrying_has_its_turns_alone(
    tmp_path: Path, name: str, write: Callable[[Path, Pulses], object], turns: int
) -> None:
    write(tmp_path / name, heard(turns=turns))
    found = read_bearings(tmp_path / name)
    assert len(found) == turns
    true_deg = math.degrees(math.atan2(*TAG))
    for one in found:
        assert one.bearing.accepted
        assert abs(difference_deg(one.bearing.bearing_deg, true_deg)) < 4.0
        assert one.start_time_ns > START_NS + (STAND_S + 15.0) * 1e9


def test_a_log_that_stands_on_the_ground_alone_is_one_turn_of_all_its_pulses(
    tmp_path: Path,
) -> None:
    """As on a turntable: nothing flew."""
    pulses = [one for one in heard() if one.pulse.start_time_ns < START_NS + STAND_S * 1e9]
    (found,) = read_bearings(as_log(tmp_path / "log.jsonl", pulses))
    assert found.bearing.pulses == len(pulses)
