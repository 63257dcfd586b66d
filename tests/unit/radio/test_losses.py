"""Samples lost without a word: found, placed and counted; nothing else is called a loss."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from depth import share

from uavrt.radio.timing.losses import most_lost
from uavrt.radio.timing.sample_placing import Placer
from uavrt_experiments.detection.arrivals import DeliveredStream, Delivery
from uavrt_experiments.detection.unsaid import TimesKept, Unsaid, place

pytestmark = pytest.mark.slow

USB = Delivery(transfer_s=65_536 / 3e6, jitter_s=0.002, stall_share=0.01)
START_NS = 1_700_000_000_000_000_000


def kept(delivery: Delivery, *seeds: int) -> TimesKept:
    """Sum over streams of two minutes, with a crystal of + 50, - 50 and 0 ppm in turn."""
    each = [
        Unsaid(delivery=delivery).keep_times(np.random.default_rng(seed), seed)
        for seed in seeds
    ]
    names = ("instants", "within", "settled", "settled_within", "lost", "found", "unsure")
    return TimesKept(**{name: sum(getattr(one, name) for one in each) for name in names})


@pytest.mark.parametrize(
    ("share", "loss_s", "jitter"),
    [
        (0.01, 0.001, "exponential"),
        (0.01, 0.005, "normal"),
        (0.01, 0.02, "exponential"),
        (0.01, 0.1, "normal"),
        (0.05, 0.001, "normal"),
        (0.05, 0.005, "exponential"),
        (0.05, 0.02, "normal"),
        (0.05, 0.05, "exponential"),
        (0.05, 0.1, "exponential"),
    ],
)
def test_losses_are_counted_and_times_stay_right(
    share: float, loss_s: float, jitter: str
) -> None:
    got = kept(replace(USB, loss_share=share, loss_s=loss_s, jitter=jitter), 0, 1, 2)  # type: ignore[arg-type]
    assert got.within >= 0.95 * got.instants
    assert got.settled_within >= 0.96 * got.settled
    assert got.found - got.unsure == pytest.approx(got.lost, rel=0.1)


@pytest.mark.parametrize("transfer_s", [0.005, 0.0328, 0.0437])
def test_writes_of_any_length_show_the_losses(transfer_s: float) -> None:
    for loss_s in (0.005, 0.1):
        got = kept(
            replace(
                USB, transfer_s=transfer_s, stall_share=0.002, loss_share=0.05, loss_s=loss_s
            ),
            3,
        )
        assert got.within >= 0.95 * got.instants
        assert got.found == pytest.approx(got.lost, rel=0.1)


def test_a_loss_within_a_long_write_costs_the_times_of_a_quarter_of_it() -> None:
    """Nothing tells where in 65 ms it lies; put behind them it costs the times of half."""
    delivery = replace(USB, transfer_s=0.0655, loss_share=0.05, loss_s=0.05)
    got = kept(delivery, *range(6))
    assert got.within >= 0.94 * got.instants
    assert got.found == pytest.approx(got.lost, rel=0.1)


@pytest.mark.parametrize("transfer_s", [0.131, 0.524])
@pytest.mark.parametrize("loss_s", [0.005, 0.1])
def test_the_half_seconds_that_rtl_sdr_writes_by_itself_show_the_losses_too(
    transfer_s: float, loss_s: float
) -> None:
    delivery = replace(
        USB, sample_rate_hz=250e3, transfer_s=transfer_s, loss_share=0.01, loss_s=loss_s
    )
    got = kept(delivery, 0, 1, 2)
    assert got.found == pytest.approx(got.lost, rel=0.1)
    assert got.unsure < 0.1 * got.lost
    assert got.within >= 0.7 * got.instants


def test_half_seconds_of_a_steady_crystal_are_never_called_a_loss() -> None:
    got = kept(replace(USB, sample_rate_hz=250e3, transfer_s=0.524), 0, 1, 2)
    assert got.found == 0
    assert got.within == got.instants


@pytest.mark.parametrize(
    ("jitter", "transfer_s", "jitter_s"),
    share(
        [*product(("exponential", "normal"), (0.005, 65_536 / 3e6, 0.0874), (0.0003, 0.002))], 3
    ),
)
def test_a_steady_crystal_is_never_called_a_loss(
    jitter: str, transfer_s: float, jitter_s: float
) -> None:
    share = 0.01 if transfer_s > 0.01 else 0.001
    steady = replace(USB, transfer_s=transfer_s, jitter=jitter, jitter_s=jitter_s)  # type: ignore[arg-type]
    got = kept(replace(steady, stall_share=share), 0, 1, 2)
    assert got.found == 0
    assert got.within == got.instants


def test_a_few_short_losses_are_rate_or_loss() -> None:
    """0.02 % in pieces too short to see one by one: a crystal 200 ppm slow looks alike."""
    lossy = kept(replace(USB, loss_share=0.0002, loss_s=0.0005), 2, 5, 8)
    stream = DeliveredStream(
        replace(USB, rate_error_ppm=-200.0), 120.0, np.random.default_rng(1)
    )
    blocks = list(place(stream))
    assert lossy.unsure > 0
    assert lossy.found - lossy.unsure <= 0.2 * lossy.lost
    assert lossy.lost <= most_lost(lossy.unsure, samples=3 * 360_000_000, sample_rate_hz=3e6)
    assert sum(b.lost_before - b.unsure_before for b in blocks) == 0
    assert 0 < sum(b.unsure_before for b in blocks) <= 200e-6 * 1.5 * stream.samples


def test_a_stall_at_the_very_start_does_not_shift_the_times() -> None:
    rate_hz = 3e6
    placer = Placer(rate_hz)
    placer.begin(START_NS)
    transfer, held, first, errors = 65_536, 0, 0, []
    for number in range(1, 400):
        taken_s = number * transfer / rate_hz
        held += transfer
        placer.arrived(held, START_NS + round(max(taken_s, 0.3) * 1e9))
        while placer.cut or held >= 4 * transfer:
            count = placer.cut or held
            block = placer.place(np.zeros(count, np.complex64))
            errors.append((block.time_ns - START_NS) * 1e-9 - first / rate_hz)
            first, held = first + count, held - count
    assert placer.lost == 0
    assert max(abs(error) for error in errors[4:]) < 0.002


def test_what_a_radio_tells_later_is_not_counted_twice() -> None:
    stream = DeliveredStream(
        Delivery(loss_share=0.02, loss_s=0.5, jitter_s=0.0005), 40.0, np.random.default_rng(0)
    )
    assert len(stream.losses) == 1
    placer = Placer(3e6)
    placer.begin(START_NS)
    told = False
    for transfer in stream.transfers():
        placer.arrived(transfer.count, START_NS + round(transfer.arrival_s * 1e9))
        if transfer.first > stream.losses[0] + 1_500_000 and not told:
            placer.add_lost(stream.lost)
            told = True
        placer.place(np.zeros(transfer.count, np.complex64))
    assert told
    assert placer.lost == pytest.approx(stream.lost, abs=0.003 * 3e6)


@pytest.mark.parametrize("transfer_s", [0.005, 0.0082])
def test_a_gap_lies_within_two_writes_of_where_samples_are_missing(transfer_s: float) -> None:
    """Wherever a block would have ended; losses less than 0.1 s apart may be one gap."""
    off_s, losses = [], 0
    for seed in range(12):
        delivery = replace(USB, transfer_s=transfer_s, stall_share=0.0, loss_share=0.02)
        stream = DeliveredStream(
            replace(delivery, loss_s=0.2), 30.0, np.random.default_rng(seed)
        )
        losses += len(stream.losses)
        came = 0
        for block in place(stream):
            if block.lost_before:
                off = np.min(np.abs(came - stream.losses))
                off_s.append(float(off) / delivery.sample_rate_hz)
            came += len(block.samples)
    assert len(off_s) >= 0.9 * losses
    assert np.quantile(off_s, 0.9) <= transfer_s + 0.001
    assert np.quantile(off_s, 0.98) <= 2.0 * transfer_s
