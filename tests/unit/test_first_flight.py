"""The list before a first flight: what is heard makes each item; a red one names the remedy."""

from dataclasses import replace
from typing import Any

import made
import pytest

from uavrt.core.commands import SystemState
from uavrt.core.messages import Pose, Poses, PulsePose, SearchReport
from uavrt.drone.computer.bench import Bench, FlightFacts, first_flight
from uavrt.drone.computer.finding import Finding

SECOND = 1_000_000_000
NOW_NS = 1_000 * SECOND
TAGS = (
    made.tag(4, 148.7e6, 1.3, pulse_width_s=0.015, name="Luna"),
    made.tag(6, 148.9e6, 1.5, pulse_width_s=0.015),
)
FACTS = FlightFacts(
    tags=TAGS,
    state=SystemState.DETECTING,
    heard=True,
    clock_off_s=0.0,
    pose_age_s=0.3,
    disk_free_mb=20_000.0,
    disk_needed_mb=500.0,
    battery_percent=96.0,
    battery_v=16.4,
    usual_noise_db=-91.0,
)
POSE = made.pose(0, 46.5, 8.0, altitude_relative_m=0.0)


def report(tag_id: int, noise_psd: float = 1e-9) -> SearchReport:
    return made.search_report(
        tag_id, 0, frequency_hz=148.7e6, noise_psd=noise_psd, best_score=0.4
    )


def heard(pose: Pose | None = POSE, clipped: bool = False) -> Bench:
    """All is well: both detectors report, one tag is on the bench."""
    bench = Bench()
    bench.add(report(4), NOW_NS - 4 * SECOND)
    bench.add(report(6), NOW_NS - 3 * SECOND)
    pulse = replace(made.pulse(0, noise_psd=1.2e-9), tag_id=4, confirmed=True, clipped=clipped)
    bench.add(PulsePose(pulse=pulse, pose=pose), NOW_NS - 2 * SECOND)
    return bench


def items(facts: FlightFacts, bench: Bench, now_ns: int = NOW_NS) -> dict[str, Finding]:
    found = first_flight(facts, bench, now_ns)
    assert all(one.ok != bool(one.remedy) for one in found), "what is red names the remedy"
    return {one.what: one for one in found}


def test_all_is_in_order_with_one_tag_on_the_bench() -> None:
    found = items(FACTS, heard())
    assert list(found) == [
        "drone",
        "radio",
        "noise",
        "time",
        "poses",
        "tags",
        "disk",
        "battery",
    ]
    assert all(one.ok for one in found.values())
    assert found["tags"].text == "1 of 2 detected: Luna"
    assert found["battery"].text == "96 % of the charge is left, 16.4 V"


def test_what_nobody_has_told_is_not_in_order() -> None:
    nothing = FlightFacts(tags=(), state=None, heard=False)
    assert not [one.what for one in items(nothing, Bench()).values() if one.ok]


def test_without_a_drone_nothing_is_advised_but_to_let_it_be_heard() -> None:
    silent = FlightFacts(tags=FACTS.tags, state=None, heard=False)
    found = items(silent, Bench())
    for what in ("radio", "noise", "time", "poses", "disk", "battery"):
        assert found[what].text == "unknown: no contact with the drone"
        assert "BATT" not in found[what].remedy


def test_free_space_is_told_in_gigabytes() -> None:
    told = items(replace(FACTS, disk_free_mb=242_213.0), heard())["disk"].text
    assert told == "242.2 GB free on the drone"


@pytest.mark.parametrize(
    ("what", "facts", "text"),
    [
        ("drone", {"heard": False}, "no contact"),
        ("radio", {"state": SystemState.HAS_TAGS}, "no detection is running"),
        ("time", {"clock_off_s": 1.7e9}, "clock is 19676 days behind this"),
        ("time", {"clock_off_s": -7200.0}, "clock is 2 h ahead of this"),
        ("time", {"time_known": False}, "is unknown"),
        ("poses", {"pose_age_s": 7.0}, "7 s old"),
        ("poses", {"pose_age_s": None}, "no position yet"),
        ("tags", {"tags": ()}, "no tags in the table"),
        ("disk", {"disk_free_mb": 80.0}, "0.1 GB free"),
        ("disk", {"disk_free_mb": None}, "has not reported"),
        ("battery", {"battery_percent": 30.0}, "30 % of the charge is left"),
        ("battery", {"battery_percent": None}, "does not report"),
    ],
)
def test_one_thing_wrong_is_named(what: str, facts: dict[str, Any], text: str) -> None:
    found = items(replace(FACTS, **facts), heard())
    assert not found[what].ok
    assert text in found[what].text
    also = {"noise", "tags"} if what == "tags" else {what}
    assert {one.what for one in found.values() if not one.ok} <= also


def test_a_silent_detector_and_a_tag_that_was_heard_long_ago_count_no_more() -> None:
    found = items(FACTS, heard(), NOW_NS + 20 * SECOND)
    assert "no report from the detector" in found["radio"].text
    assert found["tags"].ok
    assert "no tag was detected" in items(FACTS, heard(), NOW_NS + 59 * SECOND)["tags"].text


def test_noise_that_rises_or_lies_on_one_frequency_is_named() -> None:
    risen = heard()
    risen.add(report(6, 6e-9), NOW_NS)
    assert items(FACTS, risen)["noise"].text == "the noise has risen by 8 dB at 148.900 MHz"
    uneven = Bench()
    uneven.add(report(4, 2e-8), NOW_NS)
    uneven.add(report(6, 1e-9), NOW_NS)
    assert "13 dB stronger at 148.700 MHz" in items(FACTS, uneven)["noise"].text
    dead = Bench()
    dead.add(report(4, float("nan")), NOW_NS)
    dead.add(report(6, 0.0), NOW_NS)
    assert items(FACTS, dead)["noise"].text == "the noise has not been measured yet"


def one_tag(noise_psd: float) -> Bench:
    """Even and steady from the first report on, as the noise of any one tag is."""
    bench = Bench()
    for second in range(30):
        bench.add(report(4, noise_psd), NOW_NS - second * SECOND)
    return bench


def test_noise_that_is_loud_from_the_first_report_on_is_named_beside_past_flights() -> None:
    facts = replace(FACTS, tags=TAGS[:1])
    loud = items(facts, one_tag(1e-3))["noise"]
    assert loud.text == "the noise is 61 dB stronger than in past flights"
    assert "gain" in loud.remedy
    assert "switch off nearby devices" in loud.remedy
    stronger = items(facts, one_tag(8e-10 * 5))["noise"].text
    assert stronger == "the noise is 7 dB stronger than in past flights"
    assert items(facts, one_tag(8e-10 * 3))["noise"].ok
    deaf = items(facts, one_tag(1e-11))["noise"]
    assert deaf.text == "the noise is 19 dB weaker than in past flights"
    assert "antenna" in deaf.remedy


def test_without_a_past_flight_nobody_says_that_the_noise_is_normal() -> None:
    facts = replace(FACTS, tags=TAGS[:1], usual_noise_db=None)
    for noise_psd in (1e-3, 1e-9):
        found = items(facts, one_tag(noise_psd))["noise"]
        assert (found.ok, found.open) == (False, True)
        assert found.text.startswith(
            "the noise is steady, and equal within 0 dB on all tags; there is no"
        )
        assert "compared with the first" in found.remedy
    # What is wrong is so without any flight.
    risen = one_tag(1e-9)
    risen.add(report(4, 1e-8), NOW_NS)
    found = items(facts, risen)["noise"]
    assert (found.ok, found.open) == (False, False)
    assert not any(one.open for one in items(FACTS, heard()).values())


def test_a_pulse_without_position_and_one_too_loud_are_named() -> None:
    assert "clock is unknown" in items(FACTS, heard(pose=None))["time"].text
    assert "overloaded" in items(FACTS, heard(clipped=True))["tags"].text


def test_positions_of_the_drone_count_when_they_come() -> None:
    bench = Bench()
    bench.add(Poses(poses=(POSE,)), NOW_NS)
    assert bench.pose_ns == NOW_NS
    bench.reset()
    assert bench.pose_ns is None


def test_what_this_computer_has_looked_at_itself_stands() -> None:
    told = (
        Finding(what="disk", ok=False, text="full", remedy="Make room"),
        Finding(what="card", ok=True, text="well"),
    )
    found = items(replace(FACTS, own_findings=told), heard())
    assert found["disk"].text == "full"
    assert list(found)[-1] == "card"
