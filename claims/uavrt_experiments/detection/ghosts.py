"""E22: receiver images of a strong tag, with tags listed at their places."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.recorded_pulses import DetectionChain
from uavrt.core.messages import IQBlock, Pulse, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    make_samples,
    pulse_train,
)
from uavrt_experiments.detection.tracking import count_row
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import share_by_flight

RATE_HZ = 96_000.0
CENTER_HZ = 148_700_000.0
_OWN_HZ = 20_300.0
_COLLISION_S = 0.04
_BLOCK = 8192
STRONG, MIRROR, THIRD = (
    replace(THESIS_TAG, tag_id=tag_id, frequency_hz=CENTER_HZ + multiple * _OWN_HZ)
    for tag_id, multiple in ((2, 1.0), (4, -1.0), (6, -3.0 + RATE_HZ / _OWN_HZ))
)
"""The strong tag, a tag at its mirror frequency, and one at -3 times its distance from the
centre (aliased at this sample rate)."""
_LISTED = STRONG, MIRROR, THIRD
_CARRIER_HZ = -11_000.0
_SECOND_HZ = 9_000.0
WITH_CARRIER, SECOND, WITH_SECOND = (
    replace(THESIS_TAG, tag_id=tag_id, frequency_hz=CENTER_HZ + offset_hz)
    for tag_id, offset_hz in (
        (8, 2.0 * _CARRIER_HZ - _OWN_HZ),
        (10, _SECOND_HZ),
        (12, 2.0 * _OWN_HZ - _SECOND_HZ),
    )
)
"""Tags at a nonlinear receiver's product 2 f1 - f2 of the strong tag and a carrier; the second
tag; and a tag at the product with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Haunted:
    """Result of a flight with a strong tag and its ghosts."""

    strong: int
    strong_confirmed: int
    true: int
    """Pulses of the tag at a ghost's place that do not coincide with the strong tag's."""
    confirmed: int
    """Number of confirmed pulses among the true ones."""
    false: int
    """Number of confirmed pulses of the other tags that they did not send."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ghosts:
    """A strong tag through a nonlinear receiver with 8-bit quantization."""

    strong_db: float
    steps: float
    """Step of the converter, in standard deviations of the noise's real part."""
    image_db: float | None = None
    curve: float = 0.0
    """Third-order coefficient of the receiver, as the compression of the strongest signal."""
    carrier_db: float | None = None
    """Level of a steady carrier over the noise of a sample [dB]; None: no carrier."""
    second_db: float | None = None
    """Level of another tag whose pulses coincide with the strong one's for a minute [dB]; None:
    no such tag."""
    place: Tag = MIRROR
    """Tag listed at a ghost's place."""
    there_db: float | None = None
    """Level of the tag at a ghost's place [dB]; None: it is silent."""
    duration_s: float = 60.0

    def fly(self, rng: np.random.Generator, index: int) -> Haunted:
        """Run one flight with the strong tag."""
        strong = self._train(rng, STRONG, 1.254, self.strong_db)
        there = (
            [] if self.there_db is None else self._train(rng, self.place, 1.28, self.there_db)
        )
        second = [] if self.second_db is None else self._second(rng, strong, self.second_db)
        samples = make_samples(
            rng, [*strong, *second, *there], duration_s=self.duration_s, sample_rate_hz=RATE_HZ
        )
        self._receive(samples)
        tags = _LISTED if self.place is MIRROR else (STRONG, SECOND, self.place)
        found = _detect(_digitized(samples, self.steps), tags)
        pulses = [pulse for pulse in found if pulse.confirmed]
        reported_s: dict[int, list[float]] = {tag.tag_id: [] for tag in (*_LISTED, *tags)}
        for pulse in pulses:
            reported_s[pulse.tag_id].append((pulse.start_time_ns - START_NS) * 1e-9)
        free = [
            p.start_s
            for p in there
            if all(abs(p.start_s - q.start_s) > _COLLISION_S for q in strong)
        ]
        sent_s = [p.start_s for p in there]
        own_s = reported_s[self.place.tag_id]
        return Haunted(
            strong=len(strong),
            strong_confirmed=sum(_near(p.start_s, reported_s[STRONG.tag_id]) for p in strong),
            true=len(free),
            confirmed=sum(_near(at_s, own_s) for at_s in free),
            false=len(reported_s[THIRD.tag_id])
            + sum(not _near(at_s, sent_s) for at_s in own_s),
        )

    def _receive(self, samples: NDArray[np.complex64]) -> None:
        """Distort the samples as the receiver does."""
        strongest = 10.0 ** (self.strong_db / 10.0) / (THESIS_TAG.pulse_width_s * RATE_HZ)
        if self.carrier_db is not None:
            strongest = 10.0 ** (self.carrier_db / 10.0)
            turn = 2j * np.pi * _CARRIER_HZ / RATE_HZ * np.arange(len(samples))
            samples += (math.sqrt(strongest) * np.exp(turn)).astype(np.complex64)
        if self.curve:
            power = samples.real**2 + samples.imag**2
            samples *= 1.0 - np.float32(self.curve / strongest) * power
        if self.image_db is not None:
            samples += np.float32(10.0 ** (self.image_db / 20.0)) * np.conj(samples)

    @staticmethod
    def _second(
        rng: np.random.Generator, strong: list[TruePulse], enr_db: float
    ) -> list[TruePulse]:
        """Pulses whose middles coincide with another tag's within a tenth of a millisecond."""
        middle = len(strong) / 2
        return [
            replace(
                pulse,
                start_s=pulse.start_s + 1e-4 * (at - middle) + rng.uniform(-1e-3, 1e-3),
                offset_hz=_SECOND_HZ,
                enr_db=enr_db,
            )
            for at, pulse in enumerate(strong)
        ]

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


def _detect(samples: NDArray[np.complex64], tags: Sequence[Tag]) -> list[Pulse]:
    chain = DetectionChain(tags, sample_rate_hz=RATE_HZ, center_frequency_hz=CENTER_HZ)
    pulses: list[Pulse] = []
    for start in range(0, len(samples), _BLOCK):
        block = IQBlock(
            samples=samples[start : start + _BLOCK],
            sample_index=start,
            time_ns=START_NS + round(start * NANOSECONDS_PER_SECOND / RATE_HZ),
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
        if scene.there_db is not None:
            found.append(
                _share_row(
                    f"pulses of the tag at {_place(scene)} confirmed",
                    name,
                    [f.confirmed for f in flights],
                    [f.true for f in flights],
                )
            )
        return found

    full = Case(name=name, trials=24, least=4, seconds=0.6, trial=scene.fly, rows=rows)
    brief = replace(scene, duration_s=30.0)
    return replace(full, short=replace(full, least=1, trial=brief.fly))


def _place(scene: Ghosts) -> str:
    return "the mirror place" if scene.place is MIRROR else "a product's place"


def _share_row(quantity: str, name: str, found: list[int], of: list[int]) -> Row:
    return Row.with_interval(
        "E22",
        quantity,
        name,
        share_by_flight(found, of),
        sum(of),
        least=0.9,
        note=f"{len(of)} flights",
    )


_WITH_A_CARRIER = Ghosts(
    strong_db=48.0, steps=1.0, curve=0.05, carrier_db=40.0, place=WITH_CARRIER
)
_TWO_STRONG = Ghosts(strong_db=48.0, second_db=48.0, steps=3.0, curve=0.05, place=WITH_SECOND)

E22 = Experiment(
    name="E22",
    title="Ghosts of a strong tag",
    cases=(
        _case("image at −30 dB", Ghosts(strong_db=48.0, steps=3.0, image_db=-30.0)),
        _case("saturated 8-bit samples", Ghosts(strong_db=68.0, steps=6.0)),
        _case(
            "image at −30 dB, a tag at its place",
            Ghosts(strong_db=48.0, steps=3.0, image_db=-30.0, there_db=16.0),
        ),
        _case("product with a steady carrier", _WITH_A_CARRIER),
        _case(
            "product with a steady carrier, a tag at its place",
            replace(_WITH_A_CARRIER, there_db=16.0),
        ),
        _case("product of two tags", _TWO_STRONG),
        _case("product of two tags, a tag at its place", replace(_TWO_STRONG, there_db=16.0)),
    ),
)
