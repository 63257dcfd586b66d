"""Run samples of a radio at 3 MS/s through the whole detection chain, in one process."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavrt.analysis.measure.recorded_pulses import DetectionChain
from uavrt.core.messages import IQBlock, Pulse
from uavrt.core.units import ns_from_s
from uavrt_experiments.detection.cases import Case
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    add_pulse,
    noise,
    pulse_train,
)
from uavrt_experiments.detection.trials import Comparison, compare
from uavrt_experiments.result import Row


@dataclass(frozen=True, slots=True, kw_only=True)
class AntennaFlight:
    """A tag in the noise of a whole band of 3 MS/s."""

    offset_in_channel_hz: float = 0.0
    enr_db: float = 20.0
    duration_s: float = 12.0
    sample_rate_hz: float = 3e6
    channel: int = 7

    def fly(self, rng: np.random.Generator) -> Comparison:
        """Fly, and compare the reported pulses with the truth at the antenna."""
        tag = THESIS_TAG
        offset_hz = 3750.0 * self.channel + self.offset_in_channel_hz
        center_hz = tag.frequency_hz - offset_hz
        chain = DetectionChain(
            [tag], sample_rate_hz=self.sample_rate_hz, center_frequency_hz=center_hz
        )
        truth = pulse_train(
            rng,
            duration_s=self.duration_s,
            interval_s=1.254 + rng.uniform(-0.05, 0.05),
            offset_hz=offset_hz + rng.uniform(-10.0, 10.0),
            enr_db=self.enr_db,
        )
        phases = rng.uniform(0.0, 2.0 * math.pi, len(truth))
        count = round(0.0874 * self.sample_rate_hz)
        pulses: list[Pulse] = []
        for first in range(0, round(self.duration_s * self.sample_rate_hz), count):
            samples = noise(rng, count)
            for pulse, phase in zip(truth, phases, strict=True):
                shifted = replace(pulse, start_s=pulse.start_s - first / self.sample_rate_hz)
                turns = pulse.offset_hz * first / self.sample_rate_hz
                add_pulse(
                    samples,
                    shifted,
                    sample_rate_hz=self.sample_rate_hz,
                    width_s=tag.pulse_width_s,
                    phase=float(phase) + 2.0 * math.pi * (turns % 1.0),
                )
            pulses += chain.process(
                IQBlock(
                    samples=samples,
                    sample_index=first,
                    time_ns=START_NS + ns_from_s(first / self.sample_rate_hz),
                    sample_rate_hz=self.sample_rate_hz,
                )
            )
        pulses += chain.flush()
        return compare(pulses, truth, tag, center_frequency_hz=center_hz)


def antenna_case(
    name: str, flight: AntennaFlight, rows: Callable[[Sequence[Comparison]], list[Row]]
) -> Case:
    """Case of flights from 3 MS/s; generating the samples costs more than the chain."""
    return Case(
        name=name,
        trials=30,
        least=2,
        seconds=3.0,
        trial=lambda rng, _: flight.fly(rng),
        rows=rows,
    )
