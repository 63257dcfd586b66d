"""The claims about the detector, measured on seeded signals."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.thresholds import decision_interval_s
from uavrt.experiments.detection.interference import carrier, coloured_noise, impulses
from uavrt.experiments.detection.signals import (
    THESIS_TAG,
    TruePulse,
    add_pulse,
    make_samples,
    noise,
    pulse_train,
)
from uavrt.experiments.detection.theory import (
    ORIGINAL_PD,
    genie,
    poisson_interval,
    union_bound,
    wilson_interval,
)
from uavrt.experiments.detection.trials import Comparison, compare, detect, detected_once
from uavrt.messages import Tag

Samples = NDArray[np.complex64]
Extra = Callable[[np.random.Generator, int], Samples]
WHOLE_CHANNEL_HZ = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One measured figure."""

    experiment: str
    case: str
    figure: float
    low: float
    """Lower end of the 95 % interval."""
    high: float
    trials: int
    original: str = ""
    theory: str = ""


def detection_curve(
    *, trials: int, seed: int, tag: Tag = THESIS_TAG, enr_db: tuple[float, ...] = ()
) -> list[Row]:
    """E2: Pd of single decisions by ENR, whole channel searched."""
    rows = []
    for level in enr_db or tuple(float(e) for e in ORIGINAL_PD):
        hits = sum(
            detected_once(np.random.default_rng((seed, round(10 * level), i)), tag, level)
            for i in range(trials)
        )
        low, high = wilson_interval(hits, trials)
        original = ORIGINAL_PD.get(round(level)) if tag.k == 3 and level % 1 == 0 else None
        rows.append(
            Row(
                experiment=f"Pd, K = {tag.k}",
                case=f"ENR {level:g} dB",
                figure=hits / trials,
                low=low,
                high=high,
                trials=trials,
                original="" if original is None else f"{original:.3f}",
                theory=f"union {union_bound(tag.k, level):.3f}, genie {genie(tag.k, level):.3f}"
                if tag.k in (1, 2, 3, 5, 8, 12)
                else "",
            )
        )
    return rows


def false_alarms(
    *,
    seconds: float,
    seed: int,
    probability: float,
    case: str,
    make: Extra = noise,
    frequency_window_hz: float = 500.0,
) -> Row:
    """E1, E10, E11: false groups in a decision interval over the nominal."""
    tag = replace(THESIS_TAG, false_alarm_probability=probability)
    rng = np.random.default_rng(seed)
    groups = confirmed = 0
    stretch = min(seconds, 300.0)
    turns = math.ceil(seconds / stretch)
    for _ in range(turns):
        samples = make(rng, round(stretch * 3750.0))
        pulses, _ = detect(samples, tag, frequency_window_hz=frequency_window_hz)
        groups += len({pulse.group_sequence for pulse in pulses})
        confirmed += sum(pulse.confirmed for pulse in pulses)
    expected = turns * stretch / decision_interval_s(tag) * probability
    low, high = poisson_interval(groups)
    return Row(
        experiment="false alarms / nominal",
        case=f"{case}, nominal {100 * probability:g} %",
        figure=groups / expected,
        low=low / expected,
        high=high / expected,
        trials=round(expected / probability),
        theory=f"{confirmed} pulses confirmed",
    )


def follow(
    *,
    flights: int,
    seed: int,
    enr_db: float,
    duration_s: float = 300.0,
    extra: Extra | None = None,
    offset_hz: float = 333.0,
    frequency_window_hz: float = WHOLE_CHANNEL_HZ,
) -> Comparison:
    """E4 to E12: long stretches with a tag, all compared with the truth."""
    total = Comparison()
    for flight in range(flights):
        rng = np.random.default_rng((seed, flight))
        truth = pulse_train(
            rng,
            duration_s=duration_s,
            interval_s=1.254 + rng.uniform(-0.05, 0.05),
            offset_hz=offset_hz,
            enr_db=enr_db,
            jitter_s=0.005,
        )
        samples = make_samples(rng, truth, duration_s=duration_s)
        if extra is not None:
            samples += extra(rng, len(samples))
        pulses, _ = detect(samples, THESIS_TAG, frequency_window_hz=frequency_window_hz)
        result = compare(pulses, truth, THESIS_TAG)
        total.true += result.true
        total.matched += result.matched
        total.confirmed += result.confirmed
        total.false += result.false
        total.false_confirmed += result.false_confirmed
        total.time_errors_s += result.time_errors_s
        total.frequency_errors_hz += result.frequency_errors_hz
        total.snr_errors_db += result.snr_errors_db
    return total


def neighbour(*, apart_hz: float, level_db: float) -> Extra:
    """Another tag of the same interval, relative to a tag at 333 Hz; ENR `level_db`."""

    def make(rng: np.random.Generator, count: int) -> Samples:
        wave = np.zeros(count, np.complex64)
        other: list[TruePulse] = pulse_train(
            rng,
            duration_s=count / 3750.0,
            interval_s=1.254,
            offset_hz=333.0 + apart_hz,
            enr_db=level_db,
        )
        for pulse in other:
            phase = rng.uniform(0.0, 2.0 * math.pi)
            add_pulse(wave, pulse, sample_rate_hz=3750.0, width_s=0.02, phase=phase)
        return wave

    return make


def recall_row(case: str, result: Comparison, original: str = "") -> Row:
    """Recall as a row."""
    low, high = wilson_interval(result.confirmed, result.true)
    return Row(
        experiment="confirmed recall",
        case=case,
        figure=result.confirmed / max(1, result.true),
        low=low,
        high=high,
        trials=result.true,
        original=original,
        theory=f"{result.false_confirmed} false confirmed",
    )


def accuracy_rows(result: Comparison, enr_db: float) -> list[Row]:
    """E5 to E7: rms of time and frequency, bias of SNR."""
    count = len(result.time_errors_s)
    relative = 1.96 / math.sqrt(2.0 * max(1, count))

    def rms(name: str, values: list[float], scale: float, original: str) -> Row:
        value = scale * math.sqrt(float(np.mean(np.square(values))))
        return Row(
            experiment=name,
            case=f"ENR {enr_db:g} dB",
            figure=value,
            low=value * (1.0 - relative),
            high=value * (1.0 + relative),
            trials=count,
            original=original,
        )

    bias = float(np.mean(result.snr_errors_db))
    half = 1.96 * float(np.std(result.snr_errors_db)) / math.sqrt(max(1, count))
    return [
        rms("time rms, ms", result.time_errors_s, 1e3, "3.0"),
        rms("frequency rms, Hz", result.frequency_errors_hz, 1.0, "8.7"),
        Row(
            experiment="SNR bias, dB",
            case=f"ENR {enr_db:g} dB",
            figure=bias,
            low=bias - half,
            high=bias + half,
            trials=count,
            original="-1.4",
        ),
    ]


def run_detection(
    *, trials: int = 600, seed: int = 1, say: Callable[[str], None] = lambda _: None
) -> list[Row]:
    """Measure everything; `trials` decisions for a point of a curve, the rest in proportion."""
    rows: list[Row] = []
    size = trials / 600.0
    flights = max(1, round(10 * size))
    say("Pd of single decisions")
    rows += detection_curve(trials=trials, seed=seed)
    say("false alarms")
    for probability in (0.05, 0.01):
        rows.append(
            false_alarms(
                seconds=6000.0 * size / (20.0 * probability),
                seed=seed,
                probability=probability,
                case="white noise",
            )
        )
    shapes: dict[str, Extra] = {
        "6 dB tilt": lambda r, n: coloured_noise(r, n, tilt_db=6.0),
        "channel edge": lambda r, n: coloured_noise(r, n, edge=True),
        "hum": lambda r, n: coloured_noise(r, n, hum=True),
        "carrier 20 dB": lambda r, n: noise(r, n) + carrier(r, n, offset_hz=50, level_db=20),
        "carrier 40 dB": lambda r, n: noise(r, n) + carrier(r, n, offset_hz=62.5, level_db=40),
        "impulses 1/s, 40 dB": lambda r, n: noise(r, n) + impulses(r, n, per_s=1, level_db=40),
    }
    for name, make in shapes.items():
        rows.append(
            false_alarms(
                seconds=3000.0 * size,
                seed=seed,
                probability=0.05,
                case=name,
                make=make,
                frequency_window_hz=WHOLE_CHANNEL_HZ,
            )
        )
    say("tracking")
    for level, original in ((8.0, ".02"), (9.0, ".17"), (10.0, ".43"), (12.0, ".87")):
        result = follow(flights=flights, seed=seed, enr_db=level)
        rows.append(recall_row(f"ENR {level:g} dB, 300 s", result, original))
    rows += accuracy_rows(follow(flights=max(1, flights // 3), seed=seed, enr_db=20.0), 20.0)
    say("interference")
    beside: dict[str, Extra] = {
        "carrier 40 dB, 100 Hz away": lambda r, n: carrier(
            r, n, offset_hz=233.0, level_db=40.0
        ),
        "impulses 5/s, 25 dB": lambda r, n: impulses(r, n, per_s=5.0, level_db=25.0),
        "neighbour +10 dB, 500 Hz": neighbour(apart_hz=500.0, level_db=24.0),
        "neighbour +20 dB, 100 Hz": neighbour(apart_hz=100.0, level_db=34.0),
    }
    for name, extra in beside.items():
        result = follow(
            flights=max(1, flights // 3), seed=seed, enr_db=14.0, duration_s=120.0, extra=extra
        )
        rows.append(recall_row(f"14 dB, {name}", result))
    return rows
