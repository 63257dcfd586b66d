"""Which tag a number means, in logs that go together."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import made
import numpy as np
from command_line import Ran
from some import some
from turned import turns

from uavrt.analysis.estimates.positions import read_positions
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import PulsePose
from uavrt.flight.logs.pulse_files import PulseWriter
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.estimates.flight_estimates import EstimationOptions, TagPosition

PLANE = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
START_NS = 1_700_000_000 * 10**9
CORNER = (462_300.0, 5_249_900.0)
"""Of the surveys, in zone 32."""
HEADING = "Run,Timestamp,Frequency,Amplitude,Easting,Northing,Altitude,Heading,EPSG Code"
FIRST, SECOND = (150.0, 120.0), (60.0, 240.0)


def pings(path: Path, frequency_hz: float, tag: tuple[float, float]) -> Path:
    """A survey of UCSD's tracker, with an upright whip."""
    rng = np.random.default_rng(round(frequency_hz))
    lines, time_s = [HEADING], 1.7e9 + frequency_hz / 1e3
    for line, east in enumerate(range(0, 301, 50)):
        for north in range(0, 301, 12)[:: 1 if line % 2 == 0 else -1]:
            away = math.dist((east, north, 40.0), (*tag, 0.0))
            flat = max(math.dist((east, north), tag), 0.03 * away)
            level = -60.0 - 25.0 * math.log10(away) + 20.0 * math.log10(flat / away)
            level += float(rng.normal(0.0, 2.0))
            place = f"{CORNER[0] + east:.0f},{CORNER[1] + north:.0f}"
            lines.append(f"1,{time_s:.1f},{frequency_hz:.0f},{level:.2f},{place},540.0,0,32632")
            time_s += 1.5
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def turned(
    frequency_hz: float, tag: tuple[float, float], start_ns: int, tag_id: int = 2
) -> list[PulsePose]:
    """Pulses of turns at three places around a tag."""
    rng = np.random.default_rng(round(frequency_hz))
    angles = np.arange(3) * 2 * math.pi / 3
    stations = [(300.0 * math.sin(a), 300.0 * math.cos(a)) for a in angles]
    way = turns(stations, plane=PLANE, start_ns=start_ns)
    named = {"tag_id": tag_id, "frequency_hz": frequency_hz, "noise_psd": 1e-10}
    pulses = []
    for time in np.arange(0.0, way.end_s, 1.25):
        gain = float(PATTERNS["RA-23K"].gain_db(way.seen(time, tag)[0]))
        snr_db = 26.0 + gain + rng.normal(0.0, 1.0)
        pulses.append(way.pulse(time, snr_db, way.pose(time), **named))
    return pulses


def as_log(path: Path, pulses: Sequence[PulsePose]) -> Path:
    with path.open("w", encoding="utf-8") as stream:
        writer = PulseWriter(stream, "jsonl")
        for one in pulses:
            writer.write(one)
    return path


def as_flight(directory: Path, pulses: Sequence[PulsePose], name: str) -> Path:
    first = pulses[0].pulse
    tag = made.tag(first.tag_id, first.frequency_hz, 1.25, name=name)
    made.flight(
        made.flight_info(
            directory, (tag,), start_time_ns=first.start_time_ns, center_frequency_hz=148e6
        ),
        pulse_poses=list(pulses),
    )
    return directory


def off_m(found: TagPosition, tag: tuple[float, float]) -> float:
    place = some(found.position)
    return math.dist(PLANE.to_local(place.latitude_deg, place.longitude_deg), tag)


def test_two_surveys_of_two_frequencies_are_two_tags(tmp_path: Path) -> None:
    """Each log numbers its tags by frequency from 1: both were tag 1, in the middle."""
    logs = [
        pings(tmp_path / "low.csv", 172_464_000.0, FIRST),
        pings(tmp_path / "high.csv", 173_000_000.0, SECOND),
    ]
    alone = [read_positions(log, how=EstimationOptions(height_m=40.0))[0] for log in logs]
    found = read_positions(*reversed(logs), how=EstimationOptions(height_m=40.0))
    assert [one.tag_id for one in found] == [1, 2]
    assert [one.frequency_hz for one in found] == [172_464_000.0, 173_000_000.0]
    for one, own in zip(found, alone, strict=True):
        place = some(own.position)
        there = PLANE.to_local(place.latitude_deg, place.longitude_deg)
        assert off_m(one, (float(there[0]), float(there[1]))) < 0.01


def test_one_frequency_is_one_tag_whatever_number_each_log_gives_it(tmp_path: Path) -> None:
    both = pings(tmp_path / "both.csv", 172_464_000.0, FIRST)
    more = pings(tmp_path / "more.csv", 170_000_000.0, SECOND).read_text(encoding="utf-8")
    both.write_text(
        both.read_text(encoding="utf-8") + "\n".join(more.splitlines()[1:]) + "\n",
        encoding="utf-8",
    )
    (tmp_path / "more.csv").unlink()
    again = pings(tmp_path / "again.csv", 172_464_020.0, FIRST)
    found = read_positions(both, again, how=EstimationOptions(height_m=40.0))
    assert [one.tag_id for one in found] == [1, 2]
    assert [one.position.pulses for one in found if one.position] == [182, 364]


def test_a_survey_s_tag_is_the_listed_one_of_its_frequency(tmp_path: Path) -> None:
    flight = as_flight(
        tmp_path / "flight_log_2026-05-01_08-00-00",
        turned(172_464_000.0, (40.0, 60.0), START_NS),
        "Kiwi",
    )
    same = pings(tmp_path / "same.csv", 172_464_030.0, FIRST)
    other = pings(tmp_path / "other.csv", 173_000_000.0, FIRST)
    found = read_positions(flight, same, how=EstimationOptions(height_m=40.0))
    assert [one.tag_id for one in found] == [2, 2]  # by bearings, and by strength
    assert [one.name for one in found] == ["Kiwi", "Kiwi"]
    found = read_positions(flight, other, how=EstimationOptions(height_m=40.0))
    assert [(one.tag_id, one.name) for one in found] == [(1, None), (2, "Kiwi")]


def test_a_number_that_was_given_to_another_tag_has_a_position_for_each(
    tmp_path: Path, ran: Ran
) -> None:
    first = as_flight(
        tmp_path / "flight_log_2026-05-01_08-00-00",
        turned(148.0e6, (40.0, 60.0), START_NS),
        "Aroha",
    )
    second = as_flight(
        tmp_path / "flight_log_2026-06-01_08-00-00",
        turned(149.5e6, (-90.0, 20.0), START_NS + 10**15),
        "Tui",
    )
    told: list[str] = []
    found = read_positions(first, second, warn=told.append)
    assert [(one.tag_id, one.name) for one in found] == [(2, "Aroha"), (2, "Tui")]
    assert [one.frequency_hz for one in found] == [148.0e6, 149.5e6]
    assert off_m(found[0], (40.0, 60.0)) < 30.0
    assert off_m(found[1], (-90.0, 20.0)) < 30.0
    assert any(
        "tag 2 is at 148.0000 MHz in some of these and at 149.5000 MHz" in one for one in told
    )
    lines = ran("localize", first, second).out.splitlines()
    assert any(line.startswith("tag 2 (Aroha) at 148.0000 MHz: ") for line in lines)
    assert any(line.startswith("tag 2 (Tui) at 149.5000 MHz: ") for line in lines)
    records = ran("localize", tmp_path, "--json").json
    named = [(one["name"], one["frequency_hz"]) for one in records]
    assert named == [("Aroha", 148.0e6), ("Tui", 149.5e6)]


def test_a_tag_whose_frequency_drifts_by_a_kilohertz_stays_one(tmp_path: Path) -> None:
    pulses = turned(148.0e6, (40.0, 60.0), START_NS)
    later = [
        replace(
            one,
            pulse=replace(
                one.pulse,
                frequency_hz=148.0012e6,
                start_time_ns=one.pulse.start_time_ns + 10**13,
                end_time_ns=one.pulse.end_time_ns + 10**13,
            ),
        )
        for one in pulses
    ]
    logs = [as_log(tmp_path / "a.jsonl", pulses), as_log(tmp_path / "b.jsonl", later)]
    told: list[str] = []
    (found,) = read_positions(*logs, warn=told.append)
    assert some(found.position).stations == 6
    assert not any("MHz" in one for one in told)
