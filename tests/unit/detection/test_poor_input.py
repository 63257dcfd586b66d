"""Poor input is named from the samples: wrong format, gain, swapped I and Q, lost samples."""

from collections.abc import Callable
from dataclasses import replace

import made
import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.core.messages import Beep, BeepKind, IQBlock, keep_beep, mirrored_reason
from uavrt.dsp.input_check import GAIN_TOO_HIGH, GAIN_TOO_LOW, UNEQUAL, WRONG_FORMAT, InputCheck
from uavrt_experiments.detection.beeping import (
    CENTER_HZ,
    Beeper,
    Scene,
    blocks_of,
    named,
    regular,
    searched_blocks,
)

RATE_HZ = 24_000.0
TAG = made.tag(2, CENTER_HZ + 2000.0, 1.254)
Samples = NDArray[np.complex64]


def noise(sigma: float) -> Samples:
    values = np.random.default_rng(1).standard_normal(2 * 240_000) * sigma
    return values.astype(np.float32).view(np.complex64)


def blocks(samples: Samples) -> list[IQBlock]:
    step = 12_000
    return [
        made.iq_block(samples[first : first + step], first, RATE_HZ, start_ns=10**18)
        for first in range(0, len(samples), step)
    ]


def found(samples: Samples, *tag_hz: float) -> list[str]:
    check = InputCheck([made.tag(2, hz, 1.254) for hz in tag_hz], CENTER_HZ)
    return [fault for block in blocks(samples) for fault in check.check(block)]


def stepped(samples: Samples, steps: float) -> Samples:
    values = np.clip(np.round(samples.view(np.float32) * steps), -steps, steps - 1) / steps
    return values.astype(np.float32).view(np.complex64)


def unsigned_as_signed(samples: Samples) -> Samples:
    codes = np.clip(np.round(samples.view(np.float32) * 128.0 + 127.5), 0, 255)
    values = codes.astype(np.uint8).view(np.int8).astype(np.float32) / np.float32(128.0)
    return values.view(np.complex64)


def words_as_bytes(samples: Samples) -> Samples:
    words = np.round(samples.view(np.float32) * 32_768.0).astype(np.int16)
    values = words.view(np.int8).astype(np.float32) / np.float32(128.0)
    return values.view(np.complex64)


def with_line(samples: Samples) -> Samples:
    return samples + np.complex64(0.2)


@pytest.mark.parametrize(
    ("spoil", "fault"),
    [
        (lambda x: unsigned_as_signed(x), WRONG_FORMAT),
        (lambda x: words_as_bytes(x * np.float32(0.3)), UNEQUAL),
        (lambda x: x.real.astype(np.complex64), UNEQUAL),
        (lambda x: stepped(x * np.float32(0.05), 128.0), GAIN_TOO_LOW),
        (lambda x: stepped(x * np.float32(15.0), 128.0), GAIN_TOO_HIGH),
        (lambda x: stepped(x * np.float32(15.0), 32_768.0), GAIN_TOO_HIGH),
    ],
)
def test_each_fault_is_reported_once(spoil: Callable[[Samples], Samples], fault: str) -> None:
    assert found(spoil(noise(0.05))) == [fault]


def test_computed_samples_beyond_full_scale_are_no_fault() -> None:
    assert found(noise(1.0)) == []


@pytest.mark.parametrize("sigma", [0.02, 0.1, 0.4])
def test_noise_of_a_converter_with_8_bits_is_no_fault(sigma: float) -> None:
    assert found(stepped(noise(sigma), 128.0), CENTER_HZ + 2000.0) == []


def test_a_tag_on_the_dc_line_is_named_where_there_is_a_line() -> None:
    assert found(noise(0.05), CENTER_HZ + 100.0) == []
    (fault,) = found(with_line(noise(0.05)), CENTER_HZ + 100.0)
    assert "Tag 2 lies on the radio's DC line" in fault
    assert found(with_line(noise(0.05)), CENTER_HZ + 2000.0) == []


def beeper(offset_hz: float, interval_s: float = 1.254, first_s: float = 0.4) -> Beeper:
    starts_s = regular(60.0, interval_s, first_s)
    return Beeper(offset_hz=offset_hz, enr_db=22.0, width_s=0.02, starts_s=starts_s)


def scene(*beepers: Beeper) -> Scene:
    return Scene(duration_s=60.0, sample_rate_hz=RATE_HZ, seed=3, beepers=beepers)


def swapped(*tags: tuple[float, float]) -> list[Beep]:
    """Identify tags of (offset [Hz], interval [s]) in samples with I and Q swapped."""
    beepers = [beeper(*tag, first_s=0.4 + at_s) for at_s, tag in enumerate(tags)]
    listed = [
        made.tag(2 + n, CENTER_HZ + hz, interval_s) for n, (hz, interval_s) in enumerate(tags)
    ]
    wrong = (replace(one, samples=one.samples.conj()) for one in blocks_of(scene(*beepers)))
    return sorted(searched_blocks(wrong, listed, 500.0), key=lambda one: one.tag_ids)


def test_a_tag_on_the_other_side_of_the_centre_means_that_i_and_q_are_swapped() -> None:
    (one,) = swapped((8000.0, 1.254))
    assert (one.kind, one.tag_ids) == (BeepKind.MIRRORED, (2,))
    assert "tag 2 mirrored at the centre: I and Q are swapped. Swap them" in str(one)


@pytest.mark.parametrize(
    "tags",
    [
        ((2000.0, 1.254), (3500.0, 1.27)),  # each within reach of a wrong label
        ((3000.0, 1.254), (-8000.0, 1.254)),  # each fits the other's label, 5 kHz away
        ((3000.0, 1.254), (-3000.0, 0.9)),  # each at the other's frequency
    ],
)
def test_two_tags_on_the_other_side_mean_that_i_and_q_are_swapped(
    tags: tuple[tuple[float, float], ...],
) -> None:
    found = swapped(*tags)
    assert [(one.kind, one.tag_ids) for one in found] == [
        (BeepKind.MIRRORED, (2,)),
        (BeepKind.MIRRORED, (3,)),
    ]


def test_one_tag_near_the_centre_may_be_off_its_label_or_mirrored() -> None:
    (one,) = swapped((3000.0, 1.254))
    assert (one.kind, one.tag_ids) == (BeepKind.OFF_LABEL, (2,))
    both = "tag 2, 6.0 kHz below its label or tag 2 mirrored (I and Q swapped)"
    assert f"{both}? A second tag shows which" in str(one)
    (listed,) = swapped((100.0, 1.254))
    assert listed.kind is BeepKind.LISTED


def test_a_second_tag_replaces_what_a_live_stream_named_before() -> None:
    def beep(kind: BeepKind, away_hz: float) -> Beep:
        return made.beep(
            kind, frequency_hz=CENTER_HZ + away_hz, tag_ids=(2,), offsets_hz=(6e3,)
        )

    known = [beep(BeepKind.OFF_LABEL, 3000.0), beep(BeepKind.OFF_LABEL, 4000.0)]
    mirrored = beep(BeepKind.MIRRORED, 3005.0)
    assert keep_beep(known, mirrored)
    assert known == [beep(BeepKind.OFF_LABEL, 4000.0), mirrored]
    assert not keep_beep(known, mirrored)
    single = replace(beep(BeepKind.OFF_LABEL, 3005.0), reason=mirrored_reason(2))
    assert not keep_beep(known, single), "of a part of an archive in which one tag beeps"
    assert known[1] == mirrored
    assert keep_beep(known, beep(BeepKind.LISTED, 3005.0))
    assert [one.kind for one in known] == [BeepKind.OFF_LABEL, BeepKind.LISTED]


def test_a_tag_on_the_other_side_is_unlisted_while_the_listed_one_beeps() -> None:
    two = scene(beeper(8000.0), beeper(-8000.0, first_s=1.0))
    both = named(two, [made.tag(2, CENTER_HZ + 8000.0, 1.254)], 500.0)
    assert {one.kind for one in both} == {BeepKind.LISTED, BeepKind.UNLISTED}


def test_samples_that_are_missing_without_a_mark_are_named() -> None:
    samples = np.concatenate([block.samples for block in blocks_of(scene(beeper(2000.0)))])
    rng = np.random.default_rng(5)
    keep, place = np.ones(len(samples), dtype=bool), 0
    while place < len(samples):
        place += int(RATE_HZ * rng.uniform(1.0, 2.0))
        keep[place : place + int(RATE_HZ * rng.uniform(0.05, 0.2))] = False
    (one,) = searched_blocks(blocks(samples[keep]), [TAG], 500.0)
    assert (one.kind, one.tag_ids) == (BeepKind.DOUBTFUL, (2,))
    assert "ms of samples lost (USB?)" in str(one)
    (whole,) = searched_blocks(blocks(samples), [TAG], 500.0)
    assert whole.kind is BeepKind.LISTED
