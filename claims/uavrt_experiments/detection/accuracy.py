"""E5, E6, E7: accuracy of time, frequency and SNR, also measured at the antenna."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt_experiments.detection import original, theory
from uavrt_experiments.detection.antenna import AntennaFlight, antenna_case
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, TruePulse, add_pulse
from uavrt_experiments.detection.tracking import SHORT_S, flight_case, flight_rows
from uavrt_experiments.detection.trials import (
    RATE_HZ,
    WHOLE_CHANNEL_HZ,
    Comparison,
    Flight,
    detect,
)
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import mean_interval, rms, share_of

_STRONG_PULSE_DB = 60.0


def errors_of(flights: Sequence[Comparison], name: str) -> list[float]:
    """Collect all errors of one kind, time, frequency or SNR, from the flights."""
    return [error for flight in flights for error in getattr(flight, name)]


def rms_row(
    values: Sequence[float],
    *,
    experiment: str,
    quantity: str,
    case: str,
    scale: float = 1.0,
    most: float | None = None,
    original: float | None = None,
    note: str = "",
) -> Row:
    """Row with the root mean square of errors."""
    value, low, high = rms(values)
    return Row.with_interval(
        experiment,
        quantity,
        case,
        (scale * value, scale * low, scale * high),
        len(values),
        most=most,
        original=original,
        note=note,
    )


def bias_row(
    values: Sequence[float],
    *,
    experiment: str,
    quantity: str,
    case: str,
    bar: float | None,
    scale: float = 1.0,
    original: float | None = None,
    at: float | None = None,
) -> Row:
    """Row with the mean of errors."""
    low, high = mean_interval(values)
    return Row.with_interval(
        experiment,
        quantity,
        case,
        (
            scale * float(np.mean(values)) if len(values) else math.nan,
            scale * low,
            scale * high,
        ),
        len(values),
        least=None if bar is None else -bar,
        most=bar,
        original=original,
        at=at,
    )


def _level_rows(enr_db: float) -> Callable[[Sequence[Comparison]], list[Row]]:
    def rows(flights: Sequence[Comparison]) -> list[Row]:
        errors = errors_of(flights, "snr_errors_db")
        bound = theory.snr_error_db(enr_db)
        spread = float(np.std(errors))
        relative = 1.96 / math.sqrt(2.0 * max(1, len(errors)))
        return [
            bias_row(
                errors,
                experiment="E5",
                quantity="SNR bias, dB",
                case=f"ENR {enr_db:g} dB",
                bar=0.5 if enr_db >= 14.0 else None,
                original=original.SNR_BIAS_DB if enr_db >= 20.0 else None,
                at=enr_db,
            ),
            Row.with_interval(
                "E5",
                "SNR standard deviation, dB",
                f"ENR {enr_db:g} dB",
                (spread, spread * (1.0 - relative), spread * (1.0 + relative)),
                len(errors),
                most=bound + 0.3,
                note=f"bound {bound:.2f}",
            ),
        ]

    return rows


def _noise_case(strong: bool) -> Case:
    """Case for the noise density of the records, with and without a pulse of 60 dB nearby."""

    def trial(rng: np.random.Generator, _: int, *, duration_s: float = 60.0) -> list[float]:
        flight = Flight(enr_db=16.0, duration_s=duration_s)
        samples, truth = flight.samples(rng)
        if strong:
            for pulse in truth:
                other = TruePulse(
                    start_s=pulse.start_s + 0.5,
                    offset_hz=flight.offset_hz + 200.0,
                    enr_db=_STRONG_PULSE_DB,
                )
                phase = rng.uniform(0.0, 2.0 * math.pi)
                add_pulse(samples, other, sample_rate_hz=RATE_HZ, width_s=0.02, phase=phase)
        pulses, _detector = detect(samples, flight.tag)
        own = flight.tag.frequency_hz + flight.offset_hz
        return [
            10.0 * math.log10(p.noise_psd * RATE_HZ)
            for p in pulses
            if abs(p.frequency_hz - own) < 50.0
        ]

    full = Case(
        name=f"noise density, {'beside 60 dB' if strong else 'alone'}",
        trials=20,
        least=2,
        seconds=0.2,
        trial=trial,
        rows=lambda outcomes: [
            bias_row(
                [error for outcome in outcomes for error in outcome],
                experiment="E5",
                quantity="noise density bias, dB",
                case="a pulse of 60 dB 200 Hz away" if strong else "tag of 16 dB alone",
                bar=0.3,
            )
        ],
    )
    return replace(full, short=replace(full, least=1, trial=partial(trial, duration_s=SHORT_S)))


E5 = Experiment(
    name="E5",
    title="SNR",
    cases=(
        *(
            flight_case(
                name=f"ENR {level:g} dB",
                flight=Flight(enr_db=level, duration_s=120.0),
                seeds=8,
                least=2,
                rows=_level_rows(level),
            )
            for level in (10.0, 14.0, 17.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0)
        ),
        _noise_case(strong=False),
        _noise_case(strong=True),
    ),
)


def _time_rows(
    enr_db: float, most_ms: float, published: float | None
) -> Callable[[Sequence[Comparison]], list[Row]]:
    return lambda flights: [
        rms_row(
            errors_of(flights, "time_errors_s"),
            experiment="E6",
            quantity="time rms, ms",
            case=f"ENR {enr_db:g} dB",
            scale=1e3,
            most=most_ms,
            original=published,
        )
    ]


def _prediction() -> Case:
    """Case for the predicted window: True if the next pulse is in the window of a confirmed
    one.
    """

    def trial(
        rng: np.random.Generator, _: int, *, duration_s: float = 120.0
    ) -> tuple[int, int]:
        flight = Flight(enr_db=16.0, duration_s=duration_s)
        samples, truth = flight.samples(rng)
        pulses, _detector = detect(samples, flight.tag)
        inside = asked = 0
        for pulse in pulses:
            if not pulse.confirmed or pulse.predicted_next_start_ns is None:
                continue
            assert pulse.predicted_next_end_ns is not None
            later = [
                t.start_s
                for t in truth
                if t.start_s * NANOSECONDS_PER_SECOND + START_NS > pulse.end_time_ns
            ]
            if not later:
                continue
            start_ns = START_NS + ns_from_s(min(later))
            asked += 1
            end_ns = start_ns + ns_from_s(flight.tag.pulse_width_s)
            inside += (
                pulse.predicted_next_start_ns <= start_ns
                and end_ns <= pulse.predicted_next_end_ns
            )
        return inside, asked

    def rows(outcomes: Sequence[tuple[int, int]]) -> list[Row]:
        inside, asked = (sum(o[i] for o in outcomes) for i in (0, 1))
        return [
            Row.with_interval(
                "E6",
                "next pulse in the predicted window",
                "ENR 16 dB",
                share_of(inside, asked),
                asked,
                least=0.99,
            )
        ]

    full = Case(name="prediction", trials=10, least=2, seconds=0.3, trial=trial, rows=rows)
    return replace(full, short=replace(full, least=1, trial=partial(trial, duration_s=SHORT_S)))


def _delay_rows(flights: Sequence[Comparison]) -> list[Row]:
    return [
        bias_row(
            errors_of(flights, "time_errors_s"),
            experiment="E6",
            quantity="time bias at the antenna, ms",
            case="20 dB, from 3 MS/s through decimator and channelizer",
            bar=0.3,
            scale=1e3,
        ),
        rms_row(
            errors_of(flights, "time_errors_s"),
            experiment="E6",
            quantity="time rms at the antenna, ms",
            case="20 dB, from 3 MS/s through decimator and channelizer",
            scale=1e3,
            most=1.0,
            original=original.TIME_RMS_MS,
        ),
    ]


E6 = Experiment(
    name="E6",
    title="Time",
    cases=(
        flight_case(
            name="ENR 20 dB",
            flight=Flight(enr_db=20.0, duration_s=120.0),
            seeds=10,
            rows=_time_rows(20.0, 1.0, original.TIME_RMS_MS),
        ),
        flight_case(
            name="ENR 11 dB",
            flight=Flight(enr_db=11.0, duration_s=120.0),
            seeds=10,
            rows=_time_rows(11.0, 2.5, None),
        ),
        _prediction(),
        antenna_case("at the antenna", AntennaFlight(), _delay_rows),
    ),
)


def _frequency_rows(flights: Sequence[Comparison]) -> list[Row]:
    errors = errors_of(flights, "frequency_errors_hz")
    bound = theory.frequency_bound_hz(20.0, THESIS_TAG.pulse_width_s)
    return [
        rms_row(
            errors,
            experiment="E7",
            quantity="frequency rms, Hz",
            case="ENR 20 dB, one pulse",
            most=2.5,
            original=original.FREQUENCY_RMS_HZ,
            note=f"Cramér and Rao {bound:.2f}",
        ),
        bias_row(
            errors,
            experiment="E7",
            quantity="frequency bias, Hz",
            case="ENR 20 dB, tag at 333 Hz",
            bar=1.0,
            original=-8.0,
        ),
    ]


def _edge(offset_hz: float) -> Case:
    return flight_case(
        name=f"tag at {offset_hz:+g} Hz",
        flight=Flight(
            enr_db=16.0,
            duration_s=120.0,
            offset_hz=offset_hz,
            frequency_window_hz=WHOLE_CHANNEL_HZ,
        ),
        seeds=10,
        least=2,
        rows=lambda flights: flight_rows(
            flights,
            experiment="E7",
            case=f"16 dB at {offset_hz:+g} Hz, band edge 1875 Hz",
            least=0.97,
            most_false=0.0,
        ),
    )


def _shoulder(offset_hz: float) -> Case:
    return antenna_case(
        f"{offset_hz:+g} Hz from the channel's centre",
        AntennaFlight(offset_in_channel_hz=offset_hz),
        lambda flights: [
            bias_row(
                errors_of(flights, "snr_errors_db"),
                experiment="E7",
                quantity="SNR bias at the antenna, dB",
                case=f"20 dB, {offset_hz:+g} Hz from the channel's centre",
                bar=0.5,
                original=-6.0 if abs(offset_hz) > 1800.0 else None,
            )
        ],
    )


E7 = Experiment(
    name="E7",
    title="Frequency",
    cases=(
        flight_case(
            name="ENR 20 dB",
            flight=Flight(enr_db=20.0, duration_s=120.0),
            seeds=10,
            rows=_frequency_rows,
        ),
        _edge(1870.0),
        _edge(-1870.0),
        *(_shoulder(offset_hz) for offset_hz in (0.0, 1700.0, -1875.0)),
    ),
)
