"""E21: several listed tags of one band, each searched with the others."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavrt.core.messages import Pulse
from uavrt.detection.detector import PulseDetector
from uavrt.detection.group import DetectorGroup
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, make_samples, pulse_train
from uavrt_experiments.detection.tracking import count_row
from uavrt_experiments.detection.trials import RATE_HZ, blocks_of
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import share_by_flight

_COLLISION_S = 0.04
"""Distance in time below which two pulses hide each other [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """Result of a flight with several listed tags."""

    true: int
    """Number of pulses that do not coincide with another tag's."""
    confirmed: int
    """Number of confirmed pulses among the true ones, under the number of their sender."""
    wrong: int
    """Number of pulses confirmed as another tag's, without a note of ambiguity."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OneBand:
    """Tags listed at one frequency, some of which send."""

    intervals_s: tuple[tuple[float, ...], ...]
    """One or two intervals of each tag [s]; it sends at the last."""
    levels_db: tuple[float | None, ...]
    """Level of each tag [dB]; None: it is silent."""
    uncertainty_s: float = 0.06
    duration_s: float = 120.0

    def fly(self, rng: np.random.Generator, index: int) -> Heard:
        """Run one flight; in every second one the tags are listed in reverse order."""
        tags = [
            replace(
                THESIS_TAG,
                tag_id=2 * place + 2,
                pulse_intervals_s=intervals_s,
                interval_uncertainty_s=self.uncertainty_s,
            )
            for place, intervals_s in enumerate(self.intervals_s)
        ]
        trains = [
            pulse_train(
                rng,
                duration_s=self.duration_s,
                interval_s=tag.pulse_intervals_s[-1] + rng.uniform(-0.002, 0.002),
                offset_hz=rng.uniform(-50.0, 50.0),
                enr_db=level_db,
                jitter_s=0.002,
            )
            if level_db is not None
            else []
            for tag, level_db in zip(tags, self.levels_db, strict=True)
        ]
        samples = make_samples(
            rng, [p for train in trains for p in train], duration_s=self.duration_s
        )
        group = DetectorGroup()
        group.add(
            0,
            [
                PulseDetector(
                    tag, sample_rate_hz=RATE_HZ, center_frequency_hz=THESIS_TAG.frequency_hz
                )
                for tag in (tags if index % 2 == 0 else tags[::-1])
            ],
        )
        pulses: list[Pulse] = []
        for block, time_ns in blocks_of(samples):
            group.put(0, block, time_ns)
            pulses += group.collect()
        pulses += group.flush()
        reports = [((p.start_time_ns - START_NS) * 1e-9, p) for p in pulses if p.confirmed]
        true = confirmed = wrong = 0
        for tag, train in zip(tags, trains, strict=True):
            others = [p.start_s for other in trains if other is not train for p in other]
            for pulse in train:
                if any(abs(pulse.start_s - other) < _COLLISION_S for other in others):
                    continue
                by = [p for at_s, p in reports if abs(at_s - pulse.start_s) < 0.015]
                true += 1
                confirmed += any(p.tag_id == tag.tag_id for p in by)
                wrong += any(tag.tag_id not in (p.tag_id, *p.also_possible_tag_ids) for p in by)
        return Heard(true=true, confirmed=confirmed, wrong=wrong)


def _case(name: str, scene: OneBand) -> Case:
    def rows(flights: Sequence[Heard]) -> list[Row]:
        return [
            Row.with_interval(
                "E21",
                "pulses confirmed as their tag's",
                name,
                share_by_flight([f.confirmed for f in flights], [f.true for f in flights]),
                sum(f.true for f in flights),
                least=0.9,
                note=f"{len(flights)} flights",
            ),
            count_row(
                [f.wrong for f in flights],
                experiment="E21",
                quantity="pulses confirmed as another tag's beyond doubt in a flight",
                case=name,
                most=2.0,
            ),
        ]

    full = Case(name=name, trials=24, least=4, seconds=0.8, trial=scene.fly, rows=rows)
    brief = replace(scene, duration_s=50.0)
    return replace(full, short=replace(full, least=1, trial=brief.fly))


_TWO = ((1.254,), (1.294,))

E21 = Experiment(
    name="E21",
    title="Listed tags of one band",
    cases=(
        _case(
            "1254 and 1294 ± 60 ms, one silent",
            OneBand(intervals_s=_TWO, levels_db=(16.0, None)),
        ),
        _case(
            "1254 and 1294 ± 60 ms, alike", OneBand(intervals_s=_TWO, levels_db=(16.0, 16.0))
        ),
        _case(
            "1254 and 1294 ± 60 ms, one 10 dB stronger",
            OneBand(intervals_s=_TWO, levels_db=(14.0, 24.0)),
        ),
        _case(
            "three tags, one of two rates",
            OneBand(
                intervals_s=((1.254, 1.881), (1.294,), (1.334,)), levels_db=(16.0, 14.0, 18.0)
            ),
        ),
    ),
)
