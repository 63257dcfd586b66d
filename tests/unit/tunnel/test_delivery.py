import tracemalloc

from hypothesis import given
from hypothesis import strategies as st
from pulses import pulse_at

from uavrt.messages import PulsePose
from uavrt.tunnel.delivery import PATIENCE_S, REMEMBERED, PulseDelivery


def pulse_pose(number: int) -> PulsePose:
    pulse = pulse_at(
        number * 1_254_000_000,
        group_index=number % 3 + 1,
        group_sequence=number // 3,
        noise_psd=1e-9,
        detection_status="detected",
        confirmed=False,
    )
    return PulsePose(pulse=pulse, pose=None)


@given(
    st.lists(
        st.tuples(st.integers(0, 20), st.sampled_from(["expect", "recorded", "later"])),
        max_size=60,
    )
)
def test_every_pulse_goes_out_exactly_once_whatever_the_recorder_does(
    events: list[tuple[int, str]],
) -> None:
    delivery = PulseDelivery()
    sent: list[PulsePose] = []
    known: set[int] = set()
    now_s = 0.0
    for number, event in events:
        pulse = pulse_pose(number)
        if event == "expect" and number not in known:
            known.add(number)
            delivery.expect(pulse, now_s)
        elif event == "recorded":
            known.add(number)
            out = delivery.recorded(pulse)
            sent += [out] if out else []
        elif event == "later":
            now_s += 1.0
            sent += delivery.overdue(now_s)
    sent += delivery.overdue(now_s + PATIENCE_S)
    times = [item.pulse.start_time_ns for item in sent]
    assert len(times) == len(set(times)) == len(known)
    assert delivery.waiting == 0


def test_a_pulse_is_held_until_it_is_recorded() -> None:
    delivery = PulseDelivery()
    delivery.expect(pulse_pose(1), now_s=0.0)
    assert delivery.overdue(PATIENCE_S / 2) == []
    assert delivery.recorded(pulse_pose(1)) == pulse_pose(1)
    assert delivery.sent_before_recorded == 0


def test_a_recorder_that_is_away_does_not_silence_the_ground_and_is_counted() -> None:
    delivery = PulseDelivery()
    delivery.expect(pulse_pose(1), now_s=0.0)
    assert delivery.overdue(PATIENCE_S) == [pulse_pose(1)]
    assert delivery.sent_before_recorded == 1
    assert delivery.recorded(pulse_pose(1)) is None


def test_all_pulses_of_a_long_outage_of_the_recorder_go_out_once() -> None:
    delivery = PulseDelivery()
    pulses = [pulse_pose(number) for number in range(3 * REMEMBERED)]
    for pulse in pulses:
        delivery.expect(pulse, now_s=0.0)
    assert delivery.overdue(PATIENCE_S) == pulses
    assert [delivery.recorded(pulse) for pulse in pulses] == [None] * len(pulses)


def test_what_is_remembered_of_a_flight_does_not_grow_with_it() -> None:
    delivery = PulseDelivery()

    def fly(numbers: range) -> int:
        before, _ = tracemalloc.get_traced_memory()
        for number in numbers:
            delivery.expect(pulse_pose(number), now_s=0.0)
            assert delivery.recorded(pulse_pose(number)) is not None
        return tracemalloc.get_traced_memory()[0] - before

    tracemalloc.start()
    try:
        at_first = fly(range(2 * REMEMBERED))
        later = fly(range(2 * REMEMBERED, 12 * REMEMBERED))
    finally:
        tracemalloc.stop()
    assert at_first < 400 * REMEMBERED
    assert later < at_first / 3
