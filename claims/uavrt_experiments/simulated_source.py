"""The simulated radio as a sample source, in virtual time or paced by the clock."""

import time

from uavrt.core.clock import Clock
from uavrt.core.messages import IQBlock
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.synthesis import CHUNK_SAMPLES, IQSynthesizer


class SimulatedSource:
    """A `uavrt.radio.source.SampleSource` that receives a scenario from its start.

    `center_frequency_hz`, `sample_rate_hz`: tuning and rate [Hz]; by default the scenario's.
    `duration_s`: end of the recording [s]; by default with the scenario.
    `block_samples`: samples of a block.
    `clock`: with a clock, a block is returned when its last sample is due, as by a radio;
    without one, blocks are returned at once.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        center_frequency_hz: float | None = None,
        sample_rate_hz: float | None = None,
        duration_s: float | None = None,
        block_samples: int = CHUNK_SAMPLES,
        clock: Clock | None = None,
    ) -> None:
        self._synthesizer = IQSynthesizer(scenario, center_frequency_hz, sample_rate_hz)
        duration_s = scenario.duration_s if duration_s is None else duration_s
        self._total = round(duration_s * self._synthesizer.sample_rate_hz)
        self._block_samples = block_samples
        self._clock = clock
        self._next = 0
        self._closed = False

    @property
    def sample_rate_hz(self) -> float:
        """Nominal sample rate [Hz]."""
        return self._synthesizer.sample_rate_hz

    @property
    def center_frequency_hz(self) -> float:
        """Radio frequency at the middle of the band [Hz]."""
        return self._synthesizer.center_frequency_hz

    @property
    def total_samples(self) -> int | None:
        """Length of the recording [samples]; None when paced, as of a radio."""
        return None if self._clock else self._total

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Get the next block, or None when none was due within `timeout_s`.

        Raises `EOFError`: the scenario is over, or the source is closed.
        """
        count = min(self._block_samples, self._total - self._next)
        if self._closed or count <= 0:
            raise EOFError("the simulated recording has ended")
        if self._clock is not None:
            due_ns = self._synthesizer.time_ns_at(self._next + count)
            wait_s = (due_ns - self._clock.now_ns()) * 1e-9
            if timeout_s is not None and wait_s > timeout_s:
                time.sleep(timeout_s)
                return None
            time.sleep(max(0.0, wait_s))
        first = self._next
        self._next += count
        return IQBlock(
            samples=self._synthesizer.block(first, count),
            sample_index=first,
            time_ns=self._synthesizer.time_ns_at(first),
            sample_rate_hz=self._synthesizer.true_sample_rate_hz,
        )

    def close(self) -> None:
        """Stop the samples; repeated calls do no harm."""
        self._closed = True
