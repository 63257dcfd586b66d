"""How loud a receiver usually is, read of the flights that it has flown."""

import math
from pathlib import Path

import made
import pytest

from uavrt.core.errors import FormatError
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.quiet_noise import read_quiet_noise_db, read_usual_noise_db

SECOND = 1_000_000_000
TAGS = tuple(
    made.tag(number, 148.7e6 + 1e5 * number, 1.3, pulse_width_s=0.015) for number in (2, 4, 6)
)
TAKE_OFF_S, END_S = 20, 60


def flight(
    directory: Path,
    *,
    quiet_db: float = -90.0,
    motors_db: float = 8.0,
    flies: bool = True,
    first_s: int = 0,
    posed: bool = True,
) -> Path:
    """Record a flight whose motors add to the noise from take-off on."""
    info = made.flight_info(
        directory, TAGS, center_frequency_hz=math.nan, sample_rate_hz=math.nan
    )
    directory.mkdir()
    recorder = FlightRecorder.open(info)
    for second in range(END_S):
        air = flies and second >= TAKE_OFF_S
        pose = made.pose(second * SECOND, 46.5, 8.0, altitude_relative_m=40.0 if air else 0.3)
        if posed:
            recorder.write(pose)
        for tag in TAGS if second >= first_s else ():
            level_db = quiet_db + (motors_db if air else 0.0) + 0.5 * (tag.tag_id - 4)
            recorder.write(
                made.search_report(
                    tag.tag_id,
                    second * SECOND + 1,
                    frequency_hz=tag.frequency_hz,
                    noise_psd=10.0 ** (level_db / 10.0),
                    best_score=0.3,
                )
            )
    recorder.commit()
    recorder.close()
    return directory


def test_a_flights_noise_at_rest_is_that_before_take_off(tmp_path: Path) -> None:
    assert read_quiet_noise_db(flight(tmp_path / "a")) == pytest.approx(-90.0)


def test_a_flight_that_listened_in_the_air_only_tells_its_lowest_tenth(tmp_path: Path) -> None:
    late = flight(tmp_path / "late", first_s=TAKE_OFF_S + 5, motors_db=3.0)
    assert read_quiet_noise_db(late) == pytest.approx(-87.0)


def test_what_never_left_the_ground_says_nothing_of_what_is_normal(tmp_path: Path) -> None:
    assert read_quiet_noise_db(flight(tmp_path / "bench", flies=False)) is None
    assert read_quiet_noise_db(flight(tmp_path / "blind", posed=False)) is None
    assert read_quiet_noise_db(flight(tmp_path / "deaf", first_s=END_S)) is None
    with pytest.raises(FormatError):
        read_quiet_noise_db(tmp_path)


def test_the_usual_noise_is_the_median_of_the_newest_flights_that_tell(tmp_path: Path) -> None:
    flights = [
        flight(tmp_path / str(number), quiet_db=level_db)
        for number, level_db in enumerate((-90.0, -60.0, -91.0))
    ]
    bench = flight(tmp_path / "bench", quiet_db=-20.0, flies=False)
    assert read_usual_noise_db([bench, tmp_path, *flights]) == pytest.approx(-90.0)
    assert read_usual_noise_db([bench, tmp_path]) is None
    assert read_usual_noise_db([]) is None
