"""E4, E8: a tag followed for minutes: weak, fading, or with a wrong interval."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from uavrt_experiments.detection import original
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.sensitivity import points_of
from uavrt_experiments.detection.signals import THESIS_TAG
from uavrt_experiments.detection.trials import Comparison, Flight, emissions
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import count_interval, level_for, quantile, share_by_flight

SEEDS = 20
"""Number of flights of a condition at full size; ten are required."""
_CPU_PER_SECOND = 0.0025
"""CPU time for a second of the whole channel at 3750 S/s [s]."""
SHORT_S = 40.0
"""Duration of the short forms [s]: about thirty pulses show the commonest faults."""
_RAMP_S = 300.0
_RAMP_DB = (14.0, 5.0)


def flight_case(
    *,
    name: str,
    flight: Flight,
    rows: Callable[[Sequence[Comparison]], list[Row]],
    seeds: int = SEEDS,
    least: int = 3,
    brief: Flight | None = None,
) -> Case:
    """Case with flights of one condition; the default short form is a single one of 40 s."""
    full = Case(
        name=name,
        trials=seeds,
        least=least,
        seconds=flight.duration_s * _CPU_PER_SECOND,
        trial=lambda rng, _: flight.fly(rng),
        rows=rows,
    )
    short = brief or replace(flight, duration_s=SHORT_S)
    return replace(full, short=replace(full, least=1, trial=lambda rng, _: short.fly(rng)))


def recall_row(
    flights: Sequence[Comparison],
    *,
    experiment: str,
    case: str,
    least: float | None = None,
    original: float | None = None,
    at: float | None = None,
) -> Row:
    """Row with the share of the pulses that were confirmed, as a mean over the flights."""
    return Row.with_interval(
        experiment,
        "confirmed recall",
        case,
        share_by_flight([f.confirmed for f in flights], [f.true for f in flights]),
        sum(f.true for f in flights),
        least=least,
        original=original,
        at=at,
        note=f"{len(flights)} flights",
    )


def count_row(
    counts: Sequence[int],
    *,
    experiment: str,
    quantity: str,
    case: str,
    most: float | None = None,
    original: float | None = None,
    note: str = "",
) -> Row:
    """Row with the number of errors in a flight."""
    total, flights = sum(counts), len(counts)
    low, high = count_interval(counts)
    return Row.with_interval(
        experiment,
        quantity,
        case,
        (total / flights, low / flights, high / flights),
        flights,
        most=most,
        original=original,
        note=note or f"{total} in all",
    )


FALSE_CONFIRMED = "pulses confirmed falsely in a flight"


def flight_rows(
    flights: Sequence[Comparison],
    *,
    experiment: str,
    case: str,
    least: float | None = None,
    most_false: float | None = None,
    original: float | None = None,
    original_false: float | None = None,
    at: float | None = None,
) -> list[Row]:
    """Rows with recall and falsely confirmed pulses."""
    return [
        recall_row(
            flights, experiment=experiment, case=case, least=least, original=original, at=at
        ),
        count_row(
            [f.false_confirmed for f in flights],
            experiment=experiment,
            quantity=FALSE_CONFIRMED,
            case=case,
            most=most_false,
            original=original_false,
        ),
    ]


def _weak(enr_db: float) -> Case:
    tenth = enr_db == 10.0
    return flight_case(
        name=f"ENR {enr_db:g} dB",
        flight=Flight(enr_db=enr_db),
        least=10 if tenth else 3,
        brief=Flight(enr_db=enr_db, duration_s=60.0),
        rows=lambda flights: flight_rows(
            flights,
            experiment="E4",
            case=f"ENR {enr_db:g} dB, 300 s",
            least=0.90 if tenth else original.CONFIRMED_RECALL[enr_db],
            most_false=1.0,
            original=original.CONFIRMED_RECALL[enr_db],
            original_false=original.FALSE_CONFIRMED_10_DB if tenth else None,
            at=enr_db,
        ),
    )


def ramp_db(time_s: float) -> float:
    """ENR falling from 14 to 5 dB within 300 s."""
    first, last = _RAMP_DB
    return first + (last - first) * time_s / _RAMP_S


def _ramp_rows(flights: Sequence[Comparison]) -> list[Row]:
    case = "ENR falling from 14 to 5 dB in 300 s"
    shots = [
        (float(round(2.0 * level) / 2.0), sure)
        for flight in flights
        for level, sure in zip(flight.levels_db, flight.sure, strict=True)
    ]
    level, low, high, _ = level_for(points_of(shots), 0.5)
    lowest = min(at for at, _ in shots)
    return [
        Row.with_interval(
            "E4",
            "ENR for confirmed recall .5, dB",
            case,
            (max(level, lowest), low, max(high, lowest)),
            len(shots),
            most=8.5,
            original=original.HALF_CONFIRMED_DB,
            note="at most: more than half at all levels" if level < lowest else "",
        ),
        count_row(
            [f.false_confirmed for f in flights],
            experiment="E4",
            quantity=FALSE_CONFIRMED,
            case=case,
            most=1.0,
        ),
    ]


def _first_confirmed() -> Case:
    """Case for the time from the stream's start until a tag of 14 dB is confirmed."""

    def trial(rng: np.random.Generator, _: int, *, duration_s: float = 30.0) -> float:
        flight = Flight(enr_db=14.0, duration_s=duration_s)
        samples, _truth = flight.samples(rng)
        sure = [e.at_s for e in emissions(samples, flight.tag) if e.pulse.confirmed]
        return min(sure, default=flight.duration_s)

    def rows(times_s: Sequence[float]) -> list[Row]:
        return [
            Row.with_interval(
                "E4",
                "time to the first confirmed record, s (median)",
                "ENR 14 dB, from the stream's start",
                quantile(times_s, 0.5),
                len(times_s),
                most=original.FIRST_CONFIRMED_14_DB_S,
                original=original.FIRST_CONFIRMED_14_DB_S,
            )
        ]

    full = Case(
        name="first confirmed", trials=200, least=8, seconds=0.08, trial=trial, rows=rows
    )
    # Fewer have no interval of a median.
    return replace(full, short=replace(full, least=7, trial=partial(trial, duration_s=15.0)))


E4 = Experiment(
    name="E4",
    title="Tracking of weak tags",
    cases=(
        *(_weak(level) for level in original.CONFIRMED_RECALL),
        flight_case(
            name="ramp",
            flight=Flight(enr_db=ramp_db),
            rows=_ramp_rows,
            brief=Flight(enr_db=lambda time_s: ramp_db(3.0 * time_s), duration_s=100.0),
        ),
        _first_confirmed(),
    ),
)

_OFF_DB = 16.0
_OFF_S = 120.0
_OFF_SEEDS = 10


def _off(name: str, flight: Flight) -> Case:
    drifts = flight.interval_drift != 0.0 or flight.drift_hz_per_s != 0.0
    return flight_case(
        name=name,
        flight=replace(flight, duration_s=_OFF_S, enr_db=_OFF_DB),
        seeds=_OFF_SEEDS,
        # What drifts must have gone some way.
        brief=replace(flight, duration_s=60.0 if drifts else SHORT_S, enr_db=_OFF_DB),
        rows=lambda flights: flight_rows(
            flights, experiment="E8", case=f"{_OFF_DB:g} dB, {name}", least=0.97, most_false=1.0
        ),
    )


_EXACT_TAG = replace(THESIS_TAG, interval_uncertainty_s=0.0, interval_jitter_s=0.0)
_WEAK = Flight(enr_db=_OFF_DB, interval_error_s=0.0)

E8 = Experiment(
    name="E8",
    title="Interval error, jitter, drift",
    cases=(
        *(
            _off(f"interval {1e3 * error:+.1f} ms", replace(_WEAK, interval_error_s=error))
            for error in (-0.0588, -0.03, 0.0, 0.03, 0.0588)
        ),
        _off("jitter ± 10 ms", replace(_WEAK, jitter_s=0.010)),
        _off("interval drifting 2e-4 per pulse", replace(_WEAK, interval_drift=2e-4)),
        _off(
            "frequency drifting 10 Hz/s", replace(_WEAK, drift_hz_per_s=10.0, offset_hz=-600.0)
        ),
        _off("exact tag, no uncertainty", replace(_WEAK, tag=_EXACT_TAG, jitter_s=0.0)),
    ),
)
