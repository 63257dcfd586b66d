import itertools
import random
from dataclasses import replace

import made
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.messages import Health
from uavrt.drone.processes.recording.commit_times import OTHERS_S, PULSES_S, CommitTimes
from uavrt.drone.processes.recording.health_filter import PERIOD_NS, HealthFilter

STEP_S = 0.25


@given(st.integers(0, 10_000), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_commits_are_3_s_apart_and_nothing_waits_longer_than_its_time(
    seed: int, pulses: float, others: float
) -> None:
    random_ = random.Random(seed)
    times = CommitTimes()
    commits: list[float] = []
    oldest: dict[str, float] = {}
    for step in range(400):
        now_s = step * STEP_S
        if random_.random() < pulses:
            times.pulses_wait(now_s)
            oldest.setdefault("pulses", now_s)
        if random_.random() < others:
            times.others_wait(now_s)
            oldest.setdefault("others", now_s)
        if times.all_due(now_s):
            times.committed(now_s)
            oldest.clear()
            commits.append(now_s)
        elif times.pulses_due(now_s):
            times.committed(now_s, pulses_only=True)
            oldest.pop("pulses", None)
            commits.append(now_s)
        assert now_s - oldest.get("pulses", now_s) <= PULSES_S
        assert now_s - oldest.get("others", now_s) <= OTHERS_S
    for_pulses = 400 * STEP_S / PULSES_S
    for_others = 400 * STEP_S / (OTHERS_S - PULSES_S)
    assert len(commits) <= for_pulses + for_others


def test_a_commit_that_failed_is_tried_again_within_a_second_or_so() -> None:
    times = CommitTimes()
    times.pulses_wait(0.0)
    times.failed(3.0)
    assert not times.all_due(3.5)
    assert times.all_due(4.0)


def health(number: int, status: str, process: str = "connection") -> Health:
    return made.health(
        process,
        number * 1_000_000_000,
        status=status,
        ok=status == "ready",
        counters={"pulses_sent": float(number)},
    )


@given(
    st.lists(st.tuples(st.sampled_from("ab"), st.sampled_from(["ready", "fault"])), max_size=99)
)
def test_every_change_of_a_process_is_recorded_to_the_second_and_its_last_word(
    said: list[tuple[str, str]],
) -> None:
    told = HealthFilter()
    everything = [health(n, status, process) for n, (process, status) in enumerate(said)]
    recorded = [one for given in everything for one in told.to_record(given)]
    recorded += told.last()
    for process in "ab":
        own = [one for one in everything if one.process == process]
        kept = [one for one in recorded if one.process == process]
        assert kept == [one for one in own if one in kept]  # in order, none twice
        for before, after in itertools.pairwise(own):
            if before.ok != after.ok:
                assert before in kept
                assert after in kept
        assert own[-1:] == kept[-1:]
        assert own[:1] == kept[:1]
        for before, after in itertools.pairwise(kept):
            steps = [
                one.time_ns for one in own if before.time_ns < one.time_ns <= after.time_ns
            ]
            assert all(time_ns - before.time_ns < PERIOD_NS for time_ns in steps[:-1])
    assert told.left_out == len(everything) - len(recorded)


def test_arming_and_landing_are_recorded_to_the_second() -> None:
    told = HealthFilter()
    said = []
    for number in range(60):
        counters = {"autopilot_armed": float(10 <= number < 50), "autopilot_landed": 0.0}
        counters["autopilot_landed"] = float(not 14 <= number < 45)
        said.append(replace(health(number, "ready"), counters=counters))
    recorded = [one for given in said for one in told.to_record(given)] + told.last()
    assert {0, 9, 10, 13, 14, 44, 45, 49, 50, 59} <= {said.index(one) for one in recorded}
