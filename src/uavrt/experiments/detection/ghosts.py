"""E22: what a receiver makes of a strong tag, beside tags listed where it appears."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.detect import DetectionChain
from uavrt.experiments.detection.campaign import Case, Experiment
from uavrt.experiments.detection.result import Row
from uavrt.experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    make_samples,
    pulse_train,
)
from uavrt.experiments.detection.statistics import share_by_flight
from uavrt.experiments.detection.tracking import count_row
from uavrt.messages import IQBlock, Pulse, Tag

RATE_HZ = 96_000.0
CENTER_HZ = 148_700_000.0
_OWN_HZ = 20_300.0
_COLLISION_S = 0.04
_BLOCK = 8192
STRONG, MIRROR, THIRD = (
    replace(THESIS_TAG, tag_id=tag_id, frequency_hz=CENTER_HZ + multiple * _OWN_HZ)
    for tag_id, multiple in ((2, 1.0), (4, -1.0), (6, -3.0 + RATE_HZ / _OWN_HZ))
)
"""The third is where -3 times the strong one's distance is seen at this rate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Haunted:
    """What came of a flight."""

    strong: int
    """Pulses that the strong tag sent."""
    strong_confirmed: int
    true: int
    """Pulses of the tag at the mirror place that the strong one's did not hit."""
    confirmed: int
    """Of those."""
    false: int
    """Confirmed pulses of the other tags that they did not send."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ghosts:
    """A strong tag through a receiver that is not ideal, as 8 bits hold it."""

    strong_db: float
    steps: float
    """Of the converter, in standard deviations of the noise's real part."""
    image_db: float | None = None
    beside_db: float | None = None
    """Level of a tag at the mirror place; None: it is silent."""
    duration_s: float = 60.0

    def fly(self, rng: np.random.Generator, index: int) -> Haunted:
        """One flight."""
        strong = self._train(rng, STRONG, 1.254, self.strong_db)
        beside = (
            [] if self.beside_db is None else self._train(rng, MIRROR, 1.28, self.beside_db)
        )
        samples = make_samples(
            rng, [*strong, *beside], duration_s=self.duration_s, sample_rate_hz=RATE_HZ
        )
        if self.image_db is not None:
            samples += np.float32(10.0 ** (self.image_db / 20.0)) * np.conj(samples)
        pulses = [
            pulse for pulse in _detect(_digitized(samples, self.steps)) if pulse.confirmed
        ]
        told: dict[int, list[float]] = {tag.tag_id: [] for tag in (STRONG, MIRROR, THIRD)}
        for pulse in pulses:
            told[pulse.tag_id].append((pulse.start_time_ns - START_NS) * 1e-9)
        free = [
            p.start_s
            for p in beside
            if all(abs(p.start_s - q.start_s) > _COLLISION_S for q in strong)
        ]
        sent_s = [p.start_s for p in beside]
        return Haunted(
            strong=len(strong),
            strong_confirmed=sum(_near(p.start_s, told[STRONG.tag_id]) for p in strong),
            true=len(free),
            confirmed=sum(_near(at_s, told[MIRROR.tag_id]) for at_s in free),
            false=len(told[THIRD.tag_id])
            + sum(not _near(at_s, sent_s) for at_s in told[MIRROR.tag_id]),
        )

    def _train(
        self, rng: np.random.Generator, tag: Tag, interval_s: float, enr_db: float
    ) -> list[TruePulse]:
        return pulse_train(
            rng,
            duration_s=self.duration_s,
            interval_s=interval_s + rng.uniform(-0.002, 0.002),
            offset_hz=tag.frequency_hz - CENTER_HZ,
            enr_db=enr_db,
            jitter_s=0.001,
        )


def _near(at_s: float, times_s: Sequence[float]) -> bool:
    return any(abs(at_s - time_s) < 0.015 for time_s in times_s)


def _digitized(samples: NDArray[np.complex64], steps: float) -> NDArray[np.complex64]:
    values = np.clip(np.round(samples.view(np.float32) * steps), -128, 127) / 128.0
    return values.astype(np.float32).view(np.complex64)


def _detect(samples: NDArray[np.complex64]) -> list[Pulse]:
    chain = DetectionChain(
        (STRONG, MIRROR, THIRD), sample_rate_hz=RATE_HZ, center_frequency_hz=CENTER_HZ
    )
    pulses: list[Pulse] = []
    for start in range(0, len(samples), _BLOCK):
        block = IQBlock(
            samples=samples[start : start + _BLOCK],
            sample_index=start,
            time_ns=START_NS + round(start * 1e9 / RATE_HZ),
            sample_rate_hz=RATE_HZ,
        )
        pulses += chain.process(block)
    return pulses + chain.flush()


def _case(name: str, scene: Ghosts) -> Case:
    def rows(flights: Sequence[Haunted]) -> list[Row]:
        found = [
            count_row(
                [f.false for f in flights],
                experiment="E22",
                quantity="ghosts confirmed as other tags in a flight",
                case=name,
                most=1.0,
            ),
            _share_row(
                "pulses of the strong tag confirmed",
                name,
                [f.strong_confirmed for f in flights],
                [f.strong for f in flights],
            ),
        ]
        if scene.beside_db is not None:
            found.append(
                _share_row(
                    "pulses of the tag at the mirror place confirmed",
                    name,
                    [f.confirmed for f in flights],
                    [f.true for f in flights],
                )
            )
        return found

    return Case(name=name, trials=24, least=4, seconds=0.6, trial=scene.fly, rows=rows)


def _share_row(quantity: str, name: str, found: list[int], of: list[int]) -> Row:
    share, (low, high) = share_by_flight(found, of)
    return Row(
        experiment="E22",
        quantity=quantity,
        case=name,
        figure=share,
        low=low,
        high=high,
        n=sum(of),
        least=0.9,
        note=f"{len(of)} flights",
    )


E22 = Experiment(
    name="E22",
    title="Ghosts of a strong tag",
    cases=(
        _case("image at −30 dB", Ghosts(strong_db=48.0, steps=3.0, image_db=-30.0)),
        _case("saturated 8-bit samples", Ghosts(strong_db=68.0, steps=6.0)),
        _case(
            "image at −30 dB, a tag at its place",
            Ghosts(strong_db=48.0, steps=3.0, image_db=-30.0, beside_db=16.0),
        ),
    ),
)
