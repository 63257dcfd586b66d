"""The bars of delivery, in virtual time."""

from itertools import pairwise

import pytest
from depth import share

from uavrt.ground.link.delivery_receipts import Receipts
from uavrt.link.tunnel.pulses.pulse_memory import CAPACITY
from uavrt_experiments.packets.link_trial import LinkTrial, TrialResult, TrialSettings
from uavrt_experiments.packets.radio_link import RadioLinkSettings

pytestmark = pytest.mark.slow

THESIS_LOAD_S = [3.0 + 3.762 * (index // 3) for index in range(1486)]
"""1486 pulses in groups of three, as in the thesis's §5.3: half an hour."""


def trial(times_s: list[float], *, aware: bool = True, **settings: object) -> TrialResult:
    link = TrialSettings(**settings)  # type: ignore[arg-type]
    return LinkTrial(times_s, link, Receipts if aware else None).run()


@pytest.mark.parametrize("loss", share([0.0, 0.05, 0.4, 0.2], 2))
def test_of_the_thesis_load_none_is_missing_at_any_loss(loss: float) -> None:
    result = trial(THESIS_LOAD_S, radio=RadioLinkSettings(loss=loss, seed=11))
    assert result.missing == ()
    assert result.forwarding_dropped == result.buffer_full == 0
    assert result.latency_s(0.95) <= {0.0: 0.3, 0.05: 0.6, 0.2: 0.6, 0.4: 2.5}[loss]
    if loss == 0.0:
        assert result.sends == 1486


def test_eight_pulses_a_second_pass_an_ardupilot_that_hides_the_radio() -> None:
    times_s = [3.0 + index / 8 for index in range(3000)]
    radio = RadioLinkSettings(loss=0.2, seed=12)
    result = trial(times_s, radio=radio, radio_status=False, forwarding=False)
    assert result.missing == ()
    assert result.latency_s(0.95) <= 2.0
    assert result.buffer_full == 0


def test_after_a_cut_of_five_minutes_all_arrive_the_newest_first() -> None:
    times_s = [3.0 + index / 4 for index in range(2400)]
    radio = RadioLinkSettings(loss=0.05, down_from_s=100.0, down_until_s=400.0, seed=13)
    result = trial(times_s, radio=radio)
    assert result.missing == ()
    assert result.most_in_memory <= CAPACITY
    cut = {index for index, time_s in enumerate(times_s) if 105.0 < time_s < 395.0}
    order = [index for _, index in result.arrivals if index in cut]
    falls = sum(later < earlier for earlier, later in pairwise(order))
    assert falls > 0.8 * len(order)
    # The live ones do not wait for the backlog.
    live_s = sorted(
        (at_ns - 1000e9) / 1e9 - times_s[index]
        for at_ns, index in result.arrivals
        if times_s[index] > 440.0
    )
    assert live_s[len(live_s) // 2] < 1.0


def test_a_cut_longer_than_memory_is_bridged_by_the_disk() -> None:
    times_s = [3.0 + index / 10 for index in range(4000)]
    radio = RadioLinkSettings(down_from_s=20.0, down_until_s=390.0, seed=14)
    result = trial(times_s, radio=radio, drain_s=2000.0)
    assert result.most_in_memory <= CAPACITY + 1
    assert result.missing == ()


def test_a_ground_station_restarted_with_an_empty_store_becomes_complete() -> None:
    radio = RadioLinkSettings(loss=0.2, seed=15)
    result = trial(THESIS_LOAD_S, radio=radio, ground_restart_s=900.0)
    assert result.missing == ()


def test_a_plain_ground_station_gets_each_pulse_once() -> None:
    result = trial(THESIS_LOAD_S, aware=False, radio=RadioLinkSettings(loss=0.2, seed=16))
    assert result.sends == 1486
    assert result.received == pytest.approx(1486 * 0.8, rel=0.05)
    assert result.received + result.lost_in_the_air >= 1486
