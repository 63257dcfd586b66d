"""A tag keeps to its interval and to the frequencies that are searched."""

from dataclasses import replace

import made
import numpy as np
import pytest
from depth import share
from streams import fed, sent, start_s

from uavrt.core.messages import Pulse, Tag
from uavrt.detection.modes import OperatingMode
from uavrt_experiments.detection.signals import THESIS_TAG, make_samples
from uavrt_experiments.detection.trials import RATE_HZ, detect

SECONDS = 40.0
CENTER_HZ = THESIS_TAG.frequency_hz


def heard(
    tag: Tag,
    *signals: tuple[float, float, float],
    mode: OperatingMode = OperatingMode.SEARCH_SOFT_LOCK,
    excluded_hz: tuple[tuple[float, float], ...] = (),
) -> list[Pulse]:
    """What a detector tells of signals: offsets [Hz], intervals [s] and ENRs [dB]."""
    rng = np.random.default_rng(3)
    pulses = [
        pulse
        for number, (offset_hz, interval_s, enr_db) in enumerate(signals)
        for pulse in made.train(
            rng,
            SECONDS,
            enr_db,
            interval_s=interval_s,
            offset_hz=offset_hz,
            first_s=0.5 + 0.4 * number,
            jitter_s=0.002,
        )
    ]
    samples = make_samples(rng, pulses, duration_s=SECONDS)
    detector = made.detector(
        tag,
        RATE_HZ,
        center_frequency_hz=CENTER_HZ,
        operating_mode=mode,
        excluded_hz=[(CENTER_HZ + low, CENTER_HZ + high) for low, high in excluded_hz],
    )
    return fed(detector, samples) + detector.flush()


@pytest.mark.parametrize(
    ("interval_s", "enr_db"),
    share(
        [(one_s, level_db) for one_s in (1.22, 1.30, 1.32) for level_db in (14.0, 22.0, 40.0)],
        4,
    ),
)
def test_a_tag_that_is_silent_is_not_confirmed_by_one_of_another_interval(
    interval_s: float, enr_db: float
) -> None:
    tag = replace(
        THESIS_TAG,
        pulse_intervals_s=(interval_s,),
        interval_uncertainty_s=0.012,
        interval_jitter_s=0.005,
    )
    pulses = heard(tag, (100.0, 1.26, enr_db))
    assert not any(pulse.confirmed for pulse in pulses)
    assert len(pulses) <= 10


@pytest.mark.parametrize("share", [-1.0, 1.0])
def test_a_tag_at_the_bound_of_its_interval_is_heard(share: float) -> None:
    pulses = heard(THESIS_TAG, (100.0, 1.254 + 0.06 * share, 16.0))
    assert len(pulses) >= SECONDS / 1.32 - 1.0
    assert sum(pulse.confirmed for pulse in pulses) >= len(pulses) - 3


@pytest.mark.parametrize("enr_db", [12.0, 16.0, 25.0])
def test_no_pulse_is_confirmed_half_way_between_two(enr_db: float) -> None:
    """The tag beeps at twice the listed interval."""
    tag = replace(THESIS_TAG, pulse_intervals_s=(0.9,))
    truth, samples = sent(101, 45.0, enr_db, interval_s=1.8, jitter_s=0.005, offset_hz=60.0)
    starts_s = np.array([pulse.start_s for pulse in truth])
    sure_s = [start_s(pulse) for pulse in detect(samples, tag)[0] if pulse.confirmed]
    assert all(np.abs(starts_s - one).min() <= 0.01 for one in sure_s)
    assert len(sure_s) >= 0.6 * len(truth)


@pytest.mark.parametrize(("offset_hz", "enr_db"), [(150.0, 20.0), (200.0, 27.0), (250.0, 40.0)])
def test_a_known_frequency_is_kept_to_whatever_is_heard_beside_it(
    offset_hz: float, enr_db: float
) -> None:
    beside = (offset_hz, 1.254, enr_db)
    assert heard(THESIS_TAG, beside, mode=OperatingMode.KNOWN_HARD_LOCK) == []
    inside = heard(THESIS_TAG, (95.0, 1.254, 16.0), mode=OperatingMode.KNOWN_HARD_LOCK)
    assert len(inside) >= SECONDS / 1.254 - 1.0


@pytest.mark.parametrize(
    "mode", [mode for mode in OperatingMode if mode is not OperatingMode.KNOWN_HARD_LOCK]
)
def test_a_signal_in_an_excluded_stretch_does_not_hide_the_tag(mode: OperatingMode) -> None:
    signals = ((0.0, 1.254, 24.0), (300.0, 1.254, 16.0))
    pulses = heard(THESIS_TAG, *signals, mode=mode, excluded_hz=((-50.0, 50.0),))
    assert len(pulses) >= SECONDS / 1.254 - 1.0
    assert all(abs(pulse.frequency_hz - CENTER_HZ - 300.0) < 40.0 for pulse in pulses)
    assert sum(pulse.confirmed for pulse in pulses) >= len(pulses) - 4
