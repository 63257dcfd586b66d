"""Measure from a tag's strong pulses by how much the frequency slides within a pulse.

Pulses whose frequency slides are found by the filter for a constant frequency only if they are
strong. The filter for the measured slide then also finds the weak ones.
"""

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.detection.search.refine import Measured, slide_energies
from uavrt.detection.search.tuning import MEASURE
from uavrt.detection.signal.sample_buffer import SampleBuffer
from uavrt.detection.track.tracks import Track
from uavrt.detection.track.tuning import FOLLOW


class SlideEstimate:
    """Estimates the slide of one tag from the pulses of its track, until it is decided."""

    def __init__(self, tag: Tag, buffer: SampleBuffer) -> None:
        self.hz = tag.frequency_slide_hz
        """Change of the frequency within a pulse [Hz]: as listed, or as measured."""
        self._buffer = buffer
        self._track: Track | None = None
        self._last_s = 0.0
        self._energies: list[NDArray[np.float64]] = []

    def add(self, track: Track | None, upto: int) -> bool:
        """Use the newest pulse of the tag's track; True if the slide is known from now on.

        `upto`: index after the last cleaned sample. A listed slide is not measured again.
        """
        if self.hz or track is None or track.since_accepted:
            return False
        if track.last_accepted_s == self._last_s:
            return False
        if track is not self._track:
            self._track, self._energies = track, []
        self._last_s = track.last_accepted_s
        if len(self._energies) == FOLLOW.slide_pulses:
            return False
        energies = self._energies_of(track.slots[-1].measured, track.tag.pulse_width_s, upto)
        if energies is not None:
            self._energies.append(energies)
        if len(self._energies) < FOLLOW.slide_pulses:
            return False
        slides_hz = MEASURE.slides_hz
        means = np.mean(self._energies, axis=0)
        best = int(means.argmax())
        if means[best] < FOLLOW.slide_gain * means[slides_hz.index(0.0)]:
            return False
        at = min(max(best, 1), len(means) - 2)
        # Near its maximum, the log energy of a mismatched slide is close to a parabola.
        below, here, above = np.log(means[at - 1 : at + 2]).tolist()
        shift = 0.5 * (below - above) / min(below - 2.0 * here + above, -1e-9)
        step_hz = slides_hz[1] - slides_hz[0]
        self.hz = float(slides_hz[at] + step_hz * min(max(shift, -1.0), 1.0))
        return True

    def _energies_of(
        self, pulse: Measured, width_s: float, upto: int
    ) -> NDArray[np.float64] | None:
        """Energy of a pulse for each of `MEASURE.slides_hz`, in units of the noise.

        The largest of three windows counts, because a filter for a constant frequency finds the
        time of a sliding pulse only roughly. None if samples are not stored.
        """
        buffer = self._buffer
        window = round(width_s * buffer.sample_rate_hz)
        third = window // 3
        first = round(pulse.start) - third
        last = first + 2 * third
        if first < buffer.start or last + window > upto:
            return None
        energies = [
            slide_energies(buffer.view(at, at + window), buffer.sample_rate_hz)
            for at in range(first, last + 1, third)
        ]
        return np.asarray(np.max(energies, axis=0) / pulse.noise)
