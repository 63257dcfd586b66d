"""``uavrt range``: budget with the drone's own noise, groups and whole flights."""

import json
from pathlib import Path

import made
import pytest

from uavrt.cli.prediction.range import range as range_command
from uavrt.flight.flight_recorder import FlightRecorder

START_NS = 1_700_000_000_000_000_000


def write_noise(directory: Path, *, times: float = 4.0) -> Path:
    """A minute on the ground, then two in the air with some times the noise."""
    recorder = FlightRecorder.create(
        made.flight_info(directory, start_time_ns=START_NS, center_frequency_hz=150e6)
    )
    poses = []
    for second in range(180):
        air = second >= 60
        poses.append(
            made.pose(
                START_NS + second * 1_000_000_000,
                47.0,
                8.0,
                altitude_relative_m=50.0 if air else 0.0,
                altitude_amsl_m=500.0,
            )
        )
        if second % 5 == 2:
            recorder.write(
                made.search_report(
                    2,
                    poses[-1].time_ns,
                    frequency_hz=150e6,
                    noise_psd=times * 1e-12 if air else 1e-12,
                )
            )
    recorder.write(*poses)
    recorder.commit()
    recorder.close()
    return directory


def test_noise_of_a_past_flight_shortens_the_range_and_has_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = write_noise(tmp_path / "flight_log_x")
    range_command(tag_power=-40.0, as_json=True)
    quiet = json.loads(capsys.readouterr().out)
    range_command(tag_power=-40.0, flight=(flight,), as_json=True)
    noisy = json.loads(capsys.readouterr().out)
    assert noisy[0]["distance50_m"] < 0.8 * quiet[0]["distance50_m"]
    lines = {one["term"]: one["value"] for one in noisy[0]["budget"]}
    assert lines["noise of the drone in a past flight"] == pytest.approx(6.02, abs=0.01)
    (told,) = noisy[0]["noise_from"]
    assert told["flight"] == "flight_log_x"
    assert told["rise_db"] == pytest.approx(6.02, abs=0.01)
    assert quiet[0]["noise_from"] == []


def test_of_several_flights_the_median_noise_counts_and_each_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flights = tuple(
        write_noise(tmp_path / f"flight_log_{name}", times=times)
        for name, times in (("a", 2.0), ("b", 4.0), ("c", 100.0))
    )
    range_command(tag_power=-40.0, flight=flights)
    told = " ".join(capsys.readouterr().out.split())
    for name, rise in (("a", "3.0"), ("b", "6.0"), ("c", "20.0")):
        assert f"in flight_log_{name}: +{rise} dB in the air over the noise before" in told
    assert "their median is used: +6.0 dB" in told


def test_each_row_has_its_budget_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    range_command(tag_power=-40.0, pulses=(3, 10), whole_flight=True, flight_pulses=60)
    told = " ".join(capsys.readouterr().out.split())
    for row in ("K = 3", "K = 10", "whole flight of 60 pulses, RA-23K"):
        assert f"Budget of tag 2, {row}, for Pd .9" in told


@pytest.mark.parametrize(
    ("antenna", "level_db", "pulses"), [("monopole", -1.6, 400), ("RA-23K", 4.2, 100)]
)
def test_a_whole_flight_needs_what_its_antenna_length_and_tag_make_of_it(
    capsys: pytest.CaptureFixture[str], antenna: str, level_db: float, pulses: int
) -> None:
    range_command(
        tag_power=-40.0, whole_flight=True, antenna=antenna, flight_pulses=pulses, as_json=True
    )
    whole = json.loads(capsys.readouterr().out)[-1]
    # By Monte Carlo the ideal sum of 400 pulses needs -2.4 dB.
    assert whole["enr50_db"] == pytest.approx(level_db, abs=0.8)
    assert whole["enr50_db"] < whole["enr90_db"] < whole["enr50_db"] + 2.0
    assert (whole["antenna"], whole["flight_pulses"]) == (antenna, pulses)


def test_a_whole_flight_reaches_farther_than_any_group(
    capsys: pytest.CaptureFixture[str],
) -> None:
    range_command(tag_power=-40.0, pulses=(3, 10), whole_flight=True, as_json=True)
    *groups, whole = json.loads(capsys.readouterr().out)
    assert whole["k"] is None
    assert (whole["antenna"], whole["flight_pulses"]) == ("RA-23K", 400)
    assert whole["enr50_db"] == pytest.approx(2.33, abs=0.25)  # measured (I2)
    assert whole["distance50_m"] > max(one["distance50_m"] for one in groups)


def test_the_whole_flight_of_each_listed_tag_has_its_own_budget(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    listed = tmp_path / "tags.toml"
    listed.write_text(
        "[defaults]\ninterval_ms = 1254\n"
        "[[tag]]\nid = 2\nfrequency_mhz = 150.0\npulse_width_ms = 20\n"
        "[[tag]]\nid = 4\nfrequency_mhz = 173.0\npulse_width_ms = 10\n"
    )
    range_command(
        tag_power=-40.0, tags=listed, whole_flight=True, flight_pulses=60, as_json=True
    )
    found = json.loads(capsys.readouterr().out)
    whole = [one for one in found if one["k"] is None]
    assert [one["tag_id"] for one in whole] == [one["tag_id"] for one in found[:2]]
    lines = [{line["term"]: line["value"] for line in one["budget"]} for one in whole]
    assert "pulse of 10 ms" in lines[1]
    assert whole[1]["distance50_m"] < 0.9 * whole[0]["distance50_m"]
