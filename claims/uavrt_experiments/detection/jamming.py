"""E10, E11: carriers and impulses, alone and with a tag."""

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.false_alarms import (
    STRETCH_S,
    FalseAlarms,
    count_false,
    false_alarm_row,
)
from uavrt_experiments.detection.interference import carrier, impulses
from uavrt_experiments.detection.signals import THESIS_TAG, noise
from uavrt_experiments.detection.tracking import count_row, flight_rows
from uavrt_experiments.detection.trials import Comparison, Flight
from uavrt_experiments.result import Row

Samples = NDArray[np.complex64]
Interfere = Callable[[np.random.Generator, int, int], Samples]
"""Function that makes samples of interference, from a random generator, the number of samples,
and the number of the kind of interference."""
_LEVELS_DB = (10.0, 20.0, 40.0, 60.0)
"""Levels of a carrier over the noise in a bin of 50 Hz [dB]."""
_TAG_HZ = 350.0
_TAG_DB = 14.0
_SHORT_STRETCH_S = 40.0
_FALSE_TWICE = 2.0
"""Largest allowed ratio of false alarms to the nominal ones."""
_CONFIRMED_IN_300_S = 0.084
"""Largest allowed number of falsely confirmed groups in 300 s, measured over hours: twice the
limit of E1 for noise alone."""


def _alarm_case(
    *,
    experiment: str,
    name: str,
    kinds: int,
    published: float | None,
    interfere: Interfere,
    confirmed_bar: float | None,
    rounds: int = 6,
) -> Case:
    """Case with stretches of interference alone, of several kinds in turn."""

    def trial(
        rng: np.random.Generator, index: int, stretch_s: float = STRETCH_S
    ) -> FalseAlarms:
        return count_false(
            rng,
            THESIS_TAG,
            make=lambda r, n: noise(r, n) + interfere(r, n, index % kinds),
            stretch_s=stretch_s,
        )

    def rows(outcomes: Sequence[FalseAlarms]) -> list[Row]:
        return [
            false_alarm_row(
                outcomes,
                experiment=experiment,
                case=name,
                probability=THESIS_TAG.false_alarm_probability,
                least=None,
                most=_FALSE_TWICE,
                original=published,
            ),
            count_row(
                [o.confirmed for o in outcomes],
                experiment=experiment,
                quantity=f"groups confirmed falsely in {STRETCH_S:g} s",
                case=name,
                most=confirmed_bar,
            ),
        ]

    full = Case(
        name=f"{name}, alone",
        trials=kinds * rounds,
        least=kinds,
        seconds=1.0,
        trial=trial,
        rows=rows,
    )
    # The last kind is the strongest.
    brief = replace(
        full, least=1, trial=lambda rng, _: trial(rng, kinds - 1, stretch_s=_SHORT_STRETCH_S)
    )
    return replace(full, short=brief)


def _tag_case(
    *,
    experiment: str,
    name: str,
    kinds: int,
    least: float,
    published: float | None,
    interfere: Interfere,
    rounds: int = 4,
    short_s: float = _SHORT_STRETCH_S,
) -> Case:
    """Case with a tag in interference of several kinds in turn."""

    def trial(rng: np.random.Generator, index: int, duration_s: float = 120.0) -> Comparison:
        flight = Flight(
            enr_db=_TAG_DB,
            duration_s=duration_s,
            offset_hz=_TAG_HZ,
            extra=lambda r, n: interfere(r, n, index % kinds),
        )
        return flight.fly(rng)

    full = Case(
        name=f"{name}, beside a tag",
        trials=kinds * rounds,
        least=kinds,
        seconds=0.5,
        trial=trial,
        rows=lambda flights: flight_rows(
            flights,
            experiment=experiment,
            case=f"tag of {_TAG_DB:g} dB, {name}",
            least=least,
            most_false=1.0,
            original=published,
        ),
    )
    brief = replace(full, least=1, trial=lambda rng, _: trial(rng, kinds - 1, short_s))
    return replace(full, short=brief)


@dataclass(frozen=True, slots=True)
class Carrier:
    """Interference by a carrier at each of the levels.

    `offset_hz`: offset from a random whole bin of 50 Hz, or from zero [Hz].
    `anywhere`: true if the bin is random.
    """

    offset_hz: float
    _: KW_ONLY
    anywhere: bool = False
    drift_hz_per_s: float = 0.0
    modulation: float = 0.0
    levels_db: Sequence[float] = _LEVELS_DB

    def __call__(self, rng: np.random.Generator, count: int, kind: int) -> Samples:
        """Samples of a carrier with the level of the given number."""
        bin_hz = 50.0 * float(rng.integers(-30, 31)) if self.anywhere else 0.0
        return carrier(
            rng,
            count,
            offset_hz=bin_hz + self.offset_hz,
            level_db=self.levels_db[kind],
            drift_hz_per_s=self.drift_hz_per_s,
            modulation=self.modulation,
        )


class Impulses:
    """Interference by impulses at each level, of each length.

    `regular`: evenly spaced, as a serial port makes them.
    """

    KINDS = tuple((level, length) for level in (25.0, 40.0) for length in (1e-3, 5e-3))

    def __init__(self, per_s: float, *, regular: bool = False) -> None:
        self._per_s = per_s
        self._regular = regular

    def __call__(self, rng: np.random.Generator, count: int, kind: int) -> Samples:
        """Samples of impulses with the level and length of the given number."""
        level, length = self.KINDS[kind]
        return impulses(
            rng,
            count,
            per_s=self._per_s,
            level_db=level,
            length_s=length,
            regular=self._regular,
        )


_CARRIERS = {
    "carrier on a bin": Carrier(0.0, anywhere=True),
    "carrier 12.5 Hz off a bin": Carrier(12.5, anywhere=True),
    "carrier between two bins": Carrier(25.0, anywhere=True),
    "carrier at 0 Hz": Carrier(0.0),
    "carrier drifting 1 Hz/s": Carrier(0.0, anywhere=True, drift_hz_per_s=1.0),
    "carrier with 30 % AM": Carrier(0.0, anywhere=True, modulation=0.3),
}
_NEAR = {
    "steady carrier 100 Hz away": Carrier(_TAG_HZ - 100.0),
    "carrier drifting away from 100 Hz": Carrier(_TAG_HZ - 100.0, drift_hz_per_s=-1.0),
    "carrier with 30 % AM 100 Hz away": Carrier(_TAG_HZ - 100.0, modulation=0.3),
    "carrier at 0 Hz, 350 Hz away": Carrier(0.0),
}
_CLOSE = Carrier(_TAG_HZ - 50.0, levels_db=(20.0,))

E10 = Experiment(
    name="E10",
    title="Carriers",
    cases=(
        *(
            _alarm_case(
                experiment="E10",
                name=name,
                kinds=len(_LEVELS_DB),
                # 100 % of the segments at a nominal 1 %.
                published=100.0 if name in ("carrier on a bin", "carrier at 0 Hz") else None,
                interfere=made,
                confirmed_bar=_CONFIRMED_IN_300_S,
            )
            for name, made in _CARRIERS.items()
        ),
        *(
            _tag_case(
                experiment="E10",
                name=name,
                kinds=len(_LEVELS_DB),
                least=0.97,
                published=None,
                interfere=made,
                # The first pulses come before the carrier is known.
                short_s=80.0,
            )
            for name, made in _NEAR.items()
        ),
        _tag_case(
            experiment="E10",
            name="carrier of 20 dB 50 Hz away",
            kinds=1,
            least=0.5,
            published=None,
            interfere=_CLOSE,
            rounds=10,
        ),
    ),
)

_TRAINS = {f"impulses, {rate:g} a second": Impulses(rate) for rate in (0.2, 1.0, 5.0)} | {
    f"serial bursts at {rate:g} Hz": Impulses(rate, regular=True)
    for rate in (2.0, 3.0, 5.0, 10.0)
}
_PUBLISHED = {"impulses, 1 a second": 0.03, "impulses, 5 a second": 0.01}

E11 = Experiment(
    name="E11",
    title="Impulses",
    cases=(
        *(
            _alarm_case(
                experiment="E11",
                name=name,
                kinds=len(Impulses.KINDS),
                published=100.0 if name == "impulses, 1 a second" else None,
                interfere=made,
                confirmed_bar=None,
            )
            for name, made in _TRAINS.items()
        ),
        *(
            _tag_case(
                experiment="E11",
                name=name,
                kinds=len(Impulses.KINDS),
                least=0.9,
                published=_PUBLISHED.get(name),
                interfere=made,
            )
            for name, made in _TRAINS.items()
        ),
    ),
)
