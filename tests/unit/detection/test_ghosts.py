"""What a receiver makes of a strong tag is not confirmed as another, and clipping is told."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import made
import numpy as np
import pytest
from numpy.typing import NDArray
from streams import start_s

from uavrt.analysis.measure.recorded_pulses import DetectionSummary, detect
from uavrt.config.ghost_places import Receiver
from uavrt.core.messages import Pulse, Tag
from uavrt.radio.opening import open_recording
from uavrt_experiments.detection.ghosts import WITH_CARRIER, WITH_SECOND, Ghosts
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, TruePulse, make_samples

RATE_HZ = 96_000.0
CENTER_HZ = 148_700_000.0
OWN_HZ = 20_300.0
DURATION_S = 30.0
STRONG, MIRROR, THIRD = (
    replace(THESIS_TAG, tag_id=tag_id, frequency_hz=CENTER_HZ + multiple * OWN_HZ)
    for tag_id, multiple in ((2, 1), (4, -1), (6, -3 + RATE_HZ / OWN_HZ))
)
"""The third is where -3 times the strong one's offset is seen at this rate."""


def scene(
    sent: Sequence[tuple[Tag, float, float]], *, image_db: float | None = None
) -> tuple[list[list[TruePulse]], NDArray[np.complex64]]:
    """Trains of (tag, interval [s], ENR [dB]), and samples with the receiver's image."""
    rng = np.random.default_rng(5)
    trains = [
        made.train(
            rng,
            DURATION_S,
            enr_db,
            interval_s=interval_s,
            offset_hz=tag.frequency_hz - CENTER_HZ,
            jitter_s=0.001,
        )
        for tag, interval_s, enr_db in sent
    ]
    pulses = [pulse for train in trains for pulse in train]
    samples = make_samples(rng, pulses, duration_s=DURATION_S, sample_rate_hz=RATE_HZ)
    if image_db is not None:
        samples += np.float32(10.0 ** (image_db / 20.0)) * np.conj(samples)
    return trains, samples


def recorded(
    path: Path, samples: NDArray[np.complex64], tags: Sequence[Tag], *, steps: float
) -> tuple[list[Pulse], DetectionSummary]:
    """Record with 8 bits, noise of so many steps, and run `uavrt detect`'s engine over it."""
    values = np.clip(np.round(samples.view(np.float32) * steps), -128, 127)
    values.astype(np.int8).tofile(path)
    pulses: list[Pulse] = []
    source = open_recording(
        path,
        "ci8",
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=CENTER_HZ,
        start_time_ns=START_NS,
    )
    summary = detect(source, tags, pulses.extend)
    source.close()
    return pulses, summary


def confirmed(tag: Tag, pulses: Sequence[Pulse]) -> list[Pulse]:
    return [pulse for pulse in pulses if pulse.tag_id == tag.tag_id and pulse.confirmed]


def test_the_image_of_a_strong_tag_is_not_confirmed_as_another(tmp_path: Path) -> None:
    _, samples = scene([(STRONG, 1.254, 48.0)], image_db=-30.0)
    pulses, summary = recorded(tmp_path / "a.cs8", samples, (STRONG, MIRROR), steps=3.0)
    assert len(confirmed(STRONG, pulses)) >= 20
    assert not confirmed(MIRROR, pulses)
    assert summary.ghosts[4, 2] >= 18
    assert summary.clipped == 0


def test_a_tag_at_the_mirror_place_with_another_interval_keeps_its_pulses(
    tmp_path: Path,
) -> None:
    trains, samples = scene([(STRONG, 1.254, 48.0), (MIRROR, 1.28, 16.0)], image_db=-30.0)
    pulses, _ = recorded(tmp_path / "a.cs8", samples, (STRONG, MIRROR), steps=3.0)
    free = [p for p in trains[1] if all(abs(p.start_s - q.start_s) > 0.04 for q in trains[0])]
    told = [start_s(p) for p in confirmed(MIRROR, pulses)]
    kept = sum(any(abs(p.start_s - t) < 0.015 for t in told) for p in free)
    assert kept >= 0.9 * len(free)
    ghosts = [p.start_s for p in trains[0]]
    both = [t for t in told if any(abs(t - g) < 0.015 for g in ghosts)]
    assert len(both) <= 0.1 * len(told)


def test_a_saturated_converter_makes_no_tags_and_is_told(tmp_path: Path) -> None:
    _, samples = scene([(STRONG, 1.254, 68.0)])
    tags = (STRONG, MIRROR, THIRD)
    pulses, summary = recorded(tmp_path / "a.cs8", samples, tags, steps=6.0)
    assert len(confirmed(STRONG, pulses)) >= 20
    assert all(pulse.clipped for pulse in confirmed(STRONG, pulses))
    assert not confirmed(MIRROR, pulses)
    assert not confirmed(THIRD, pulses)
    assert summary.ghosts[6, 2] >= 15
    assert summary.clipped >= 20
    assert summary.clipped_share == pytest.approx(0.02 / 1.254, rel=0.3)


def test_ghosts_lie_at_the_mirror_and_at_multiples_across_the_edge() -> None:
    receiver = Receiver(CENTER_HZ, RATE_HZ)
    strong = CENTER_HZ + OWN_HZ
    assert receiver.makes(CENTER_HZ - OWN_HZ, strong)
    assert receiver.makes(CENTER_HZ - 3.0 * OWN_HZ + RATE_HZ, strong)
    assert not receiver.makes(strong + 300.0, strong)
    assert not receiver.makes(CENTER_HZ - OWN_HZ + 200.0, strong)
    assert receiver.makes(2.0 * strong - (CENTER_HZ + 9e3), strong, [CENTER_HZ + 9e3])
    assert not receiver.makes(2.0 * strong - (CENTER_HZ + 9e3), strong)


def test_the_share_of_a_search_that_is_ghosts_places_is_that_of_tags_drawn_at_random() -> None:
    receiver = Receiver(CENTER_HZ, RATE_HZ)
    strong, partners = CENTER_HZ + OWN_HZ, [CENTER_HZ - 11e3, CENTER_HZ + 9e3]
    nominal_hz = CENTER_HZ - OWN_HZ + 100.0
    drawn = nominal_hz + np.random.default_rng(8).uniform(-500.0, 500.0, 20_000)
    share = receiver.share_of_band(
        strong, partners, nominal_hz=nominal_hz, half_width_hz=1000.0
    )
    hit = sum(receiver.makes(float(hz), strong, partners) for hz in drawn)
    assert 0.02 < share == pytest.approx(hit / len(drawn), rel=0.1)


@pytest.mark.parametrize(
    ("place", "carrier_db", "second_db", "steps"),
    [(WITH_CARRIER, 40.0, None, 1.0), (WITH_SECOND, None, 48.0, 3.0)],
)
def test_what_a_curved_receiver_makes_of_two_signals_is_no_tag_and_a_tag_there_is_heard(
    place: Tag, carrier_db: float | None, second_db: float | None, steps: float
) -> None:
    """A tag and a steady carrier, or two tags whose pulses come together."""
    haunted = Ghosts(
        strong_db=48.0,
        steps=steps,
        curve=0.05,
        carrier_db=carrier_db,
        second_db=second_db,
        place=place,
        duration_s=30.0,
    )
    flight = haunted.fly(np.random.default_rng(6), 0)
    assert flight.false <= 2
    assert flight.strong_confirmed >= 0.9 * flight.strong
    flight = replace(haunted, there_db=16.0).fly(np.random.default_rng(6), 0)
    assert flight.confirmed >= 0.9 * flight.true
    assert flight.false <= 2


def beside(apart_hz: float, interval_s: float) -> Tag:
    """A tag so far from the strong one that neither search reaches the other's frequency."""
    frequency_hz = STRONG.frequency_hz + apart_hz
    return replace(STRONG, tag_id=8, frequency_hz=frequency_hz, pulse_intervals_s=(interval_s,))


@pytest.mark.parametrize("apart_hz", [2000.0, 2300.0])
def test_the_edges_of_a_strong_tags_pulses_are_no_tag_beside_it(
    apart_hz: float, tmp_path: Path
) -> None:
    silent = beside(apart_hz, 1.28)
    [strong], samples = scene([(STRONG, 1.254, 48.0)])
    pulses, summary = recorded(tmp_path / "a.cs8", samples, (STRONG, silent), steps=3.0)
    assert summary.confirmed[STRONG.tag_id] >= 0.9 * len(strong)
    edges = [p for p in pulses if p.tag_id == silent.tag_id]
    assert sum(p.ghost_of_tag_id == STRONG.tag_id for p in edges) >= 5
    assert not [p for p in edges if p.confirmed]


def test_a_tag_beside_a_strong_one_of_nearly_its_interval_keeps_its_pulses(
    tmp_path: Path,
) -> None:
    weak = beside(2000.0, 1.28)
    trains, samples = scene([(STRONG, 1.254, 48.0), (weak, 1.28, 16.0)])
    _, summary = recorded(tmp_path / "a.cs8", samples, (STRONG, weak), steps=3.0)
    assert summary.confirmed[weak.tag_id] >= 0.85 * len(trains[1])
