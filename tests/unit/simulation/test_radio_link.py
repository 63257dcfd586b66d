"""The simulated radios carry what the firmware's arithmetic says."""

import pytest

from uavrt.core.units import ns_from_s
from uavrt_experiments.packets.radio_link import RadioLink, RadioLinkSettings, VirtualTime


def carried_bytes_s(*, both: bool, seconds: float = 60.0) -> float:
    """Bytes a second that reach the ground when the sender is never idle."""
    time = VirtualTime()
    got: list[int] = []
    link = RadioLink(
        time, RadioLinkSettings(), to_ground=lambda f: got.append(len(f)), to_air=lambda f: None
    )
    time.every(ns_from_s(0.009), lambda: link.send_down(bytes(50)), end_ns=ns_from_s(seconds))
    if both:
        time.every(ns_from_s(0.009), lambda: link.send_up(bytes(50)), end_ns=ns_from_s(seconds))
    time.run_until(ns_from_s(seconds))
    return sum(got) / seconds


@pytest.mark.parametrize(("both", "bytes_s"), [(True, 3167), (False, 50 / 0.009)])
def test_a_busy_pair_carries_3167_bytes_a_second_each_way_and_one_alone_all(
    both: bool, bytes_s: float
) -> None:
    assert carried_bytes_s(both=both) == pytest.approx(bytes_s, rel=0.03)


def test_what_does_not_fit_into_the_buffer_is_counted() -> None:
    time = VirtualTime()
    got: list[bytes] = []
    link = RadioLink(time, RadioLinkSettings(), to_ground=got.append, to_air=lambda f: None)
    for _ in range(100):
        link.send_down(bytes(145))
        link.send_up(bytes(145))
    time.run_until(ns_from_s(20.0))
    counters = link.air.counters
    assert counters.given == 100 == counters.carried + counters.buffer_full
    assert counters.carried == len(got)
    assert counters.buffer_full > 0
    assert link.buffer_free_percent == 100


def test_the_loss_is_as_asked_and_an_outage_loses_all() -> None:
    time = VirtualTime()
    got: list[int] = []
    settings = RadioLinkSettings(loss=0.2, down_from_s=500.0, down_until_s=900.0)
    link = RadioLink(
        time, settings, to_ground=lambda f: got.append(time.now_ns), to_air=lambda f: None
    )
    end_ns = ns_from_s(1000.0)
    time.every(ns_from_s(0.1), lambda: link.send_down(bytes(200)), end_ns=end_ns)
    time.run_until(end_ns)
    before = [t for t in got if t < ns_from_s(500.0)]
    assert len(before) == pytest.approx(4000, rel=0.03)
    assert not [t for t in got if ns_from_s(500.1) < t < ns_from_s(900.0)]
