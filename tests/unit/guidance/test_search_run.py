"""Searches flown to their end, and ended, by both autopilots' manners in virtual time."""

import math
from dataclasses import replace
from typing import Any

import made
import numpy as np
import pytest
from flown import HOME
from searched import Animal, Searched, pulse, report
from some import some

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import PlanError
from uavrt.core.messages import Course, FoundTag, Neighbour, PulsePose
from uavrt.guidance.operator_orders import Limits
from uavrt.guidance.plans import Go
from uavrt.guidance.search.pulse_evidence import Antenna, PulseEvidence, threshold_db
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import MODES

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
TAG = made.tag(2, 150e6, 1.0)


@BOTH
def test_it_finds_a_resting_and_a_walking_animal_and_returns(flavour: Flavour) -> None:
    animals = [Animal(150.0, -60.0), Animal(-90.0, 120.0, walks=(0.3, 0.2), level_db=42.0)]
    search = Searched(flavour, animals)
    search.begin()
    search.run(900.0)
    assert search.flown.authority.reason == "returning: the autopilot flies home"
    assert search.flown.vehicle.mode == MODES[flavour]["return"]
    assert set(search.errors_m) == {2, 4}
    found = [note for note in search.notes if note.event == "found"]
    for note in found:
        tag = {one.tag_id: one for one in note.tags}[some(note.tag_id)]
        assert tag.radius95_m <= 25.0
        assert tag.found_s == pytest.approx(note.elapsed_s)
    assert max(search.errors_m.values()) < 35.0


@BOTH
def test_each_decision_has_a_reason(flavour: Flavour) -> None:
    search = Searched(flavour, [Animal(150.0, -60.0)])
    search.begin()
    search.run(60.0)
    begun, *notes = search.notes
    assert begun.event == "begun"
    assert len(begun.area) == 16
    assert len([note for note in notes if note.event == "decision"]) >= 3
    for note in notes:
        assert note.reason
        assert "nats" not in note.reason
        assert note.tags[0].pulses + note.tags[0].missed > 0 or note.elapsed_s < 12.0


@BOTH
@pytest.mark.parametrize("how", ["mode", "go to", "pause", "sticks", "height"])
def test_a_takeover_ends_a_search_for_good(flavour: Flavour, how: str) -> None:
    search = Searched(flavour, [Animal(150.0, -60.0)], seed=len(how))
    flown = search.flown
    if how == "sticks":
        flown.channels = (1500, 1500, 1400, 1500)
        flown.run(0.5)
    search.begin()
    search.run(15.0 + 3.0 * len(how))
    assert not search.out
    match how:
        case "mode":
            flown.vehicle.set_mode(MODES[flavour]["position"])
        case "go to":
            flown.go_to(-150.0, 150.0)
        case "pause":
            flown.pause()
        case "sticks":
            flown.channels = (1500, 1700, 1400, 1500)
        case "height":
            flown.change_height(9.0)
    search.run(1.0, until=lambda: False)
    assert search.out
    sent = len(flown.commands)
    search.run(30.0, until=lambda: False)
    assert len(flown.commands) == sent


def test_what_is_thought_after_a_takeover_moves_nothing() -> None:
    search = Searched("px4", [Animal(150.0, -60.0)])
    search.begin()
    search.run(20.0)
    flown, now = search.flown, search.flown.now()
    assert now is not None
    late = search.search_run.decide(search.time_ns, now, idle=True)
    flown.vehicle.set_mode(MODES["px4"]["position"])
    flown.run(0.6)
    sent = len(flown.commands)
    search.execution.redirect(some(late.steps), now)
    flown.run(20.0)
    assert len(flown.commands) == sent


def test_a_tag_that_is_not_there_is_not_found_and_its_places_are_told() -> None:
    search = Searched("px4", [], absent=1, duration_s=100.0, radius_m=150.0)
    search.begin()
    search.run(150.0)
    assert search.flown.authority.reason == "returning: the autopilot flies home"
    assert search.notes[-1].reason == "the search time is over"
    now = some(search.flown.now())
    (unknown,) = search.search_run.end(search.time_ns, now, "over").tags
    assert unknown.found_s is None
    assert unknown.existence < 0.5
    assert unknown.missed > 40
    assert unknown.likely
    shares = [share for *_, share in unknown.likely]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) <= 1.0


def test_it_returns_with_the_reserve_whatever_the_search_says() -> None:
    limits = Limits(battery_wh=60.0, speed_m_s=8.0, fence_m=500.0)
    search = Searched(
        "px4", [], absent=1, limits=limits, frame=Frame(battery_wh=60.0), radius_m=150.0
    )
    search.begin()
    search.run(900.0)
    assert search.flown.vehicle.mode == MODES["px4"]["return"]
    search.run(120.0, until=lambda: not search.flown.vehicle.armed)
    assert not search.flown.vehicle.armed
    assert search.flown.vehicle.body.battery_percent >= limits.reserve_percent


@BOTH
def test_a_turn_is_left_when_an_animal_walks_to_the_drone(flavour: Flavour) -> None:
    search = Searched(flavour, [Animal(60.0, -60.0)])
    search.begin()
    search.run(2.5)
    now = some(search.flown.now())
    search_run, time_ns = search.search_run, search.time_ns
    search_run._course = replace(search_run._course, goal_m=None, near=0.0)
    assert search_run.decide(time_ns, now, idle=False).steps is None
    state = search_run._search.beliefs[2].tracker._state
    spread = np.random.default_rng(1).normal(0.0, 14.0, (2, len(state.east_m)))
    state.east_m[:], state.north_m[:] = 70.0 + spread[0], spread[1]
    state.east_m_s[:], state.north_m_s[:] = -1.0, 0.0
    now = replace(now, speed_m_s=0.0)
    choice = search_run.decide(time_ns, now, idle=False)
    (go,) = some(choice.steps)
    assert isinstance(go, Go)
    east, north = TangentPlane(
        latitude_deg=HOME.latitude_deg, longitude_deg=HOME.longitude_deg
    ).to_local(*go.place)
    # Away from the animal, which is 70 m to the east: there the drone may not go.
    assert math.hypot(70.0 - east, north) > 72.0


def test_silence_counts_only_while_a_detector_listens() -> None:
    deaf = Searched("px4", [], absent=1, listens=False)
    deaf.begin()
    deaf.run(40.0)
    assert {note.tags[0].missed for note in deaf.notes} == {0}


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"tags": (9,)}, "tag 9 is not searched for by the drone"),
        ({"radius_m": None}, "no area"),
        ({"radius_m": 900.0}, "beyond the fence"),
        ({"accuracy_m": 0.0}, "the accuracy of 0 m"),
        ({"height_m": 5.0}, "the least permitted is"),
        ({"radius_m": None, "places": ((0, 0), (0, 90), (90, 0), (90, 90))}, "crosses itself"),
    ],
)
def test_what_cannot_be_searched_is_refused(values: dict[str, Any], said: str) -> None:
    search = Searched("px4", [Animal(50.0, 0.0)])
    places = values.get("places", ())
    values["places"] = tuple(search.flown.place(*corner) for corner in places)
    with pytest.raises(PlanError, match=said):
        search.seeker_of(replace(search.order(), **values))


def test_without_tags_or_battery_it_is_refused() -> None:
    search = Searched("px4", [])
    with pytest.raises(PlanError, match="not searching for any tag"):
        search.seeker_of(search.order())
    search = Searched("px4", [Animal(50.0, 0.0)], limits=Limits())
    with pytest.raises(PlanError, match="battery capacity"):
        search.seeker_of(search.order())


# ------------------------------------------------------------------------ what it hears


@pytest.fixture
def ears() -> PulseEvidence:
    plane = TangentPlane(latitude_deg=HOME.latitude_deg, longitude_deg=HOME.longitude_deg)
    made = PulseEvidence([TAG], plane, tag_height_m=0.5)
    for step in range(400):
        made.place(
            Antenna(
                time_s=0.1 * step, east_m=float(step), north_m=0.0, height_m=40.0, yaw_deg=90.0
            )
        )
    return made


def listen(ears: PulseEvidence, start_s: int, end_s: int) -> None:
    for second in range(start_s, end_s):
        ears.searched(report(2, second * 10**9), float(second))


def test_what_was_not_heard_is_told_where_the_drone_was_then(ears: PulseEvidence) -> None:
    listen(ears, 0, 20)
    missed = ears.missed()
    # Three pulses of a group and two more, and 1.5 s: until 6.5 s before the last report.
    assert len(missed) == 12
    assert missed[3].listening.east_m == pytest.approx(35.0, abs=1.0)
    assert missed[3].listening.snr_db is None
    assert missed[3].listening.height_m == 39.5
    assert ears.missed() == []


def test_a_pulse_fills_its_time_also_when_it_is_told_late(ears: PulseEvidence) -> None:
    listen(ears, 0, 5)
    for second in (3.4, 2.4, 1.4):
        heard = pulse(TAG, round(second * 1e9), 20.0)
        ears.pulse(PulsePose(pulse=heard, pose=None), second)
    pose = Searched("px4", []).heard(TAG, 20.0)
    for _ in range(2):
        ears.pulse(pose, 5.4)
    assert (ears.counts(2), ears.refused) == ((1, 0), 4)
    doubtful = replace(pose.pulse, start_time_ns=1, also_possible_tag_ids=(4,))
    assert ears.pulse(replace(pose, pulse=doubtful), 6.4) is None
    listen(ears, 5, 17)
    assert [round(one.time_s - 0.5) for one in ears.missed()] == [0, 4, 7, 8]


def test_a_gap_in_the_reports_is_no_silence(ears: PulseEvidence) -> None:
    listen(ears, 0, 10)
    before = [one.time_s for one in ears.missed()]
    listen(ears, 20, 30)
    after = [one.time_s for one in ears.missed()]
    assert before
    assert after
    assert max(before) < 4.0
    assert min(after) > 20.0


def test_a_pulse_below_the_threshold_was_not_heard(ears: PulseEvidence) -> None:
    weak = pulse(TAG, 2 * 10**9, 5.0, detection_status="subthreshold")
    assert ears.pulse(PulsePose(pulse=weak, pose=None), 2.0) is None
    listen(ears, 0, 12)
    assert len(ears.missed()) == 4


def test_the_threshold_falls_with_the_pulses_of_a_group() -> None:
    from uavrt.detection.sensitivity import enr_needed_db

    for k in (1, 3, 10):
        needed = enr_needed_db(replace(TAG, k=k, interval_uncertainty_s=0.06), 0.5)
        assert threshold_db(k) == pytest.approx(needed, abs=0.7)


CODE = made.tag(
    2,
    150e6,
    4.0,
    pulse_width_s=0.0025,
    interval_uncertainty_s=0.004,
    k=10,
    gaps_s=(0.022, 0.0488, 0.0366),
)


@pytest.mark.parametrize(("codes", "every_s"), [(1, 1), (500, 25)])
def test_silence_of_a_coded_tag_is_that_no_burst_stands_out(codes: int, every_s: int) -> None:
    """Sums of ten bursts come a minute late, those of strong ones at once."""
    plane = TangentPlane(latitude_deg=HOME.latitude_deg, longitude_deg=HOME.longitude_deg)
    ears = PulseEvidence([CODE], plane, tag_height_m=0.5, codes=codes)
    for step in range(400):
        ears.place(
            Antenna(time_s=0.1 * step, east_m=0.0, north_m=0.0, height_m=40.0, yaw_deg=90.0)
        )
    search = Searched("px4", [])
    strong, weak = search.heard(CODE, 20.0), search.heard(CODE, 4.0)
    weak = replace(weak, pulse=replace(weak.pulse, start_time_ns=1))
    for second in range(0, 26, every_s):
        ears.searched(report(2, second * 10**9), float(second))
    heard = ears.pulse(strong, 5.0)
    missed = ears.missed()
    assert [round(one.time_s) for one in missed] == [2, 10, 14]
    late = ears.pulse(weak, 9.0)
    alone, together = threshold_db(1, coded=True), threshold_db(10, coded=True)
    assert {one.listening.threshold_db for one in (*missed, some(heard))} == {alone}
    assert some(late).listening.threshold_db == together < 4.0 < alone


def test_noise_that_changes_with_the_heading_changes_no_energy(ears: PulseEvidence) -> None:
    search = Searched("px4", [])
    listen(ears, 0, 20)
    quiet = some(ears.pulse(search.heard(TAG, 20.0), 3.0)).listening
    again = search.heard(TAG, 14.0)
    louder = replace(again.pulse, start_time_ns=1, noise_psd=4e-9)
    loud = some(ears.pulse(replace(again, pulse=louder), 5.0)).listening
    assert loud.snr_db == pytest.approx(quiet.snr_db, abs=0.1)
    assert loud.threshold_db == pytest.approx(quiet.threshold_db + 6.0, abs=0.1)
    ears.searched(replace(report(2, 20 * 10**9), noise_psd=2e-9), 20.0)
    raised = {round(one.listening.threshold_db - quiet.threshold_db) for one in ears.missed()}
    assert raised == {3}


def test_another_gain_after_the_radio_was_reopened_changes_no_energy(
    ears: PulseEvidence,
) -> None:
    search = Searched("px4", [])
    listen(ears, 0, 20)
    quiet = some(ears.pulse(search.heard(TAG, 20.0), 3.0)).listening
    ears.searched(replace(report(2, 60 * 10**9), noise_psd=16e-9), 60.0)
    heard = search.heard(TAG, 20.0)
    louder = replace(heard.pulse, start_time_ns=1, noise_psd=16e-9)
    loud = some(ears.pulse(replace(heard, pulse=louder), 5.0)).listening
    assert loud.snr_db == pytest.approx(quiet.snr_db, abs=0.1)
    assert loud.threshold_db == pytest.approx(quiet.threshold_db, abs=0.1)


def test_headings_come_from_the_attitude_of_the_antenna(ears: PulseEvidence) -> None:
    search = Searched("px4", [])
    search.flown.vehicle.heading.yaw_deg = 250.0
    evidence = some(ears.pulse(search.heard(TAG, 20.0), 3.0))
    yaw = some(evidence.listening.yaw_deg)
    assert math.isclose(yaw, 250.0, abs_tol=1e-6)


@pytest.mark.parametrize(
    ("how", "taken"),
    [("well", True), ("vague", False), ("afar", False), ("idle", False), ("old", False)],
)
def test_what_another_has_found_counts_only_as_far_as_it_may_be_true(
    how: str, taken: bool
) -> None:
    """A word that is false, or of another search, must not end this one."""
    search = Searched("px4", [Animal(150.0, -60.0)])
    search.begin()
    search.run(2.0)
    now = some(search.flown.now())
    place = search.flown.place(*((4_000.0, 0.0) if how == "afar" else (150.0, -60.0)))
    found = FoundTag(tag_id=2, place=place, radius95_m=400.0 if how == "vague" else 25.0)
    course = Course(
        sequence=1,
        place=place,
        altitude_amsl_m=490.0,
        goal=place,
        searching=how != "idle",
        found=(found,),
    )
    told = Neighbour(vehicle=2, course=course, age_s=60.0 if how == "old" else 0.0)
    choice = search.search_run.decide(search.time_ns, now, idle=True, others=(told,))
    assert ("found" in {note.event for note in choice.notes}) is taken
    assert choice.returning is taken
