import made
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.messages import Pulse
from uavrt.drone.processes.recording.missing_poses import AwaitedPoses

TRIAL_TIMEOUT_S = 8.0


def pulse(number: int, tag_id: int) -> Pulse:
    return made.pulse(number * 1_000_000_000, tag_id=tag_id)


@given(
    st.lists(
        st.tuples(st.sampled_from(["pulse", "pose", "lost", "later"]), st.integers(1, 3)),
        max_size=80,
    )
)
def test_every_pulse_gets_its_pose_or_is_given_up_once(events: list[tuple[str, int]]) -> None:
    awaited = AwaitedPoses(TRIAL_TIMEOUT_S)
    now_s = 0.0
    waiting: dict[int, list[tuple[Pulse, float]]] = {1: [], 2: [], 3: []}
    posed: list[Pulse] = []
    vain: list[Pulse] = []
    everything: list[Pulse] = []
    for number, (event, tag_id) in enumerate(events):
        if event == "pulse":
            everything.append(pulse(number, tag_id))
            waiting[tag_id].append((everything[-1], now_s))
            awaited.add(everything[-1], now_s)
        elif event == "pose" and waiting[tag_id]:
            first, _ = waiting[tag_id].pop(0)
            vain += awaited.pose_arrived(first)
            posed.append(first)
        elif event == "lost" and waiting[tag_id]:
            waiting[tag_id].pop(0)  # the process that gives poses died with it
        elif event == "later":
            now_s += 3.0
            overdue = awaited.overdue(now_s)
            vain += overdue
            for own in waiting.values():
                own[:] = [item for item in own if item[0] not in overdue]
            # Nobody who is still in time is given up.
            assert all(
                now_s - since_s < TRIAL_TIMEOUT_S
                for own in waiting.values()
                for _, since_s in own
            )
    vain += awaited.all()
    assert len(awaited) == 0
    key = {one: index for index, one in enumerate(everything)}
    assert sorted(posed + vain, key=key.__getitem__) == everything


def test_a_pulse_told_again_waits_no_longer_than_the_first_time() -> None:
    awaited = AwaitedPoses(TRIAL_TIMEOUT_S)
    awaited.add(pulse(1, 2), 0.0)
    awaited.add(pulse(1, 2), 5.0)
    assert awaited.overdue(TRIAL_TIMEOUT_S) == [pulse(1, 2)]
    assert awaited.pose_arrived(pulse(1, 2)) == []
