"""`uavrt detect RECORDING --flight DIR`: for a tag that was added after the flight."""

import math
from pathlib import Path

import made
import numpy as np
import pytest
from command_line import Ran
from sigmf_meta import write_meta
from some import some

from uavrt.core.clock import iso_utc
from uavrt.core.earth.attitude import yaw_deg
from uavrt.flight.reading.flight_reader import read_flight

CENTER_HZ, RATE_HZ, SECONDS = 148.7e6, 375_000, 12
START_NS = 1_714_543_200_000_000_000
KNOWN = made.tag(2, 148.71e6, 1.0)


@pytest.fixture
def flown(tmp_path: Path) -> Path:
    """A flight that turned at 30°/s, and a recording of it with a tag nobody had listed."""
    directory = tmp_path / "flight_log_2024-05-01_06-00-00"
    info = made.flight_info(
        directory, (KNOWN,), start_time_ns=START_NS, center_frequency_hz=CENTER_HZ
    )
    poses = (
        made.pose(
            START_NS + n * 50_000_000,
            35.0,
            -111.0,
            altitude_relative_m=100.0,
            altitude_amsl_m=2200.0,
            yaw_deg=1.5 * n,
        )
        for n in range(20 * (SECONDS + 1))
    )
    made.flight(info, poses=poses)
    t = np.arange(RATE_HZ * SECONDS) / RATE_HZ
    rng = np.random.default_rng(3)
    x = 0.01 * rng.standard_normal((t.size, 2)).view(complex)[:, 0] / np.sqrt(2)
    amplitude = 0.01 * np.sqrt(100.0 / (0.020 * RATE_HZ))
    x += amplitude * ((t - 0.4) % 1.3 < 0.020) * np.exp(-2j * np.pi * 43_210.0 * t)
    flat = np.column_stack((x.real, x.imag)).ravel()
    (tmp_path / "iq.sigmf-data").write_bytes((flat * 32768).round().astype("<i2").tobytes())
    capture = {"frequency": CENTER_HZ, "datetime": iso_utc(START_NS)}
    write_meta(tmp_path / "iq", RATE_HZ, capture, datatype="ci16_le")
    (tmp_path / "new.txt").write_text("14, 148656790, 1300, 20, 20, 5, 3, 0.01\n")
    return directory


def test_a_tag_added_afterwards_is_found_with_the_poses_of_the_flight(
    flown: Path, ran: Ran
) -> None:
    folder = flown.parent
    recording, tags = folder / "iq.sigmf-meta", folder / "new.txt"
    said = ran("detect", recording, "--tags", tags, "--flight", flown).err
    assert "0 without" in said
    again = read_flight(said.strip().splitlines()[-1].removeprefix("flight: "))
    assert Path(again.info.directory).parent == folder
    assert Path(again.info.directory) != flown
    assert len(again.pulse_poses) >= 8
    for recorded in again.pulse_poses:
        assert recorded.pulse.tag_id == 14
        center_s = (recorded.pulse.start_time_ns - START_NS) / 1e9 + 0.010
        error = yaw_deg(some(recorded.pose).quaternion_wxyz) - 30.0 * center_s
        assert abs(math.remainder(error, 360.0)) < 0.1
    # The flight itself is as it was.
    assert read_flight(flown).pulse_poses == ()


def test_a_new_flight_can_itself_be_searched_again(flown: Path, ran: Ran) -> None:
    folder = flown.parent
    recording, tags = folder / "iq.sigmf-meta", folder / "new.txt"
    first, second = folder / "first", folder / "second"
    ran("detect", recording, "--tags", tags, "--flight", flown, "-o", first)
    # Without --tags the tags of the flight are searched.
    ran("detect", recording, "--flight", first, "-o", second)
    assert read_flight(second).pulse_poses == read_flight(first).pulse_poses
    assert read_flight(second).info.tags[0].tag_id == 14
