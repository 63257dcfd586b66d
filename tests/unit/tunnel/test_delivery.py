import tracemalloc

from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.messages import PulseKey
from uavrt.link.tunnel.pulses.delivery import REMEMBERED, PulseDelivery


def key(number: int) -> PulseKey:
    return 2, number * 1_254_000_000


@given(
    st.lists(st.tuples(st.integers(0, 20), st.sampled_from(["pose", "recorded"])), max_size=60)
)
def test_every_pulse_goes_out_at_once_and_once(events: list[tuple[int, str]]) -> None:
    delivery = PulseDelivery()
    sent: set[int] = set()
    for number, event in events:
        if event == "pose":
            assert delivery.may_send(key(number)) == (number not in sent)
            sent.add(number)
        else:
            # What another process let out is for the database to say.
            assert delivery.recorded(key(number)) == (number in sent)
    assert delivery.unrecorded <= len(sent)


def test_all_pulses_of_a_long_outage_of_the_recorder_go_out_once() -> None:
    delivery = PulseDelivery()
    pulses = [key(number) for number in range(3 * REMEMBERED)]
    assert all(delivery.may_send(pulse) for pulse in pulses)
    assert delivery.unrecorded == len(pulses)
    assert all(delivery.recorded(pulse) for pulse in pulses)
    assert delivery.unrecorded == 0


def test_who_comes_before_a_pulse_is_recorded_finds_it_in_the_database_afterwards() -> None:
    delivery = PulseDelivery()
    first, second = key(1), key(2)
    delivery.may_send(first)
    delivery.station_appeared()
    delivery.may_send(second)
    assert not delivery.recorded(first)
    assert delivery.recorded(second)
    assert delivery.recorded(first)
    assert not delivery.may_send(first)


def test_what_is_remembered_of_a_flight_does_not_grow_with_it() -> None:
    delivery = PulseDelivery()

    def fly(numbers: range) -> int:
        before, _ = tracemalloc.get_traced_memory()
        for number in numbers:
            assert delivery.may_send(key(number))
            assert delivery.recorded(key(number))
        return tracemalloc.get_traced_memory()[0] - before

    tracemalloc.start()
    try:
        at_first = fly(range(2 * REMEMBERED))
        later = fly(range(2 * REMEMBERED, 12 * REMEMBERED))
    finally:
        tracemalloc.stop()
    assert at_first < 400 * REMEMBERED
    assert later < at_first / 3
