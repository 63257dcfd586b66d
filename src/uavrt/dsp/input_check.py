"""Detect faults of the radio's samples: a wrong format or gain, or a tag on the DC line."""

from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import IQBlock, Tag
from uavrt.core.units import ns_from_s
from uavrt.dsp.clipping import CLIPPED_AMPLITUDE, COMPUTED_AMPLITUDE

_EVERY_NS: Final = ns_from_s(1.0)
_EXAMINED_SAMPLES: Final = 8192
"""Maximum number of samples of a block that are examined for faults."""
_FEWEST_SAMPLES: Final = 1024
_CONSECUTIVE_CHECKS: Final = 3
"""Number of consecutive checks that must show an input fault before it is reported."""
_SAME_LEVEL: Final = 0.6
"""Maximum share of samples with the same converter value. At this share the noise is 0.6
converter steps rms, and quantisation costs 1 dB."""
_EMPTY_MIDDLE: Final = 0.25
"""Amplitude above which all samples of a wrong format lie, unlike noise [full scales]."""
_UNEQUAL_RATIO: Final = 4.0
"""Ratio of the powers of I and Q above which the input is faulty, since no radio produces
it."""
_CLIPPED_SHARE: Final = 0.05
"""Maximum share of values at the converter's limits; more clipping distorts the noise."""
_ON_DC_HZ: Final = 300.0
_DC_RATIO: Final = 30.0
"""Minimum power of the DC line over the noise that counts as a disturbance."""

WRONG_FORMAT: Final = "Wrong sample format? The values do not look like noise"
UNEQUAL: Final = "I and Q differ in power: wrong format, or one is missing"
GAIN_TOO_LOW: Final = "Gain too low: noise is below a converter's step"

GAIN_TOO_HIGH: Final = "Gain too high: samples are at the converter's limits"


class InputCheck:
    """Checks the radio's samples once a second for faults that affect the searched tags."""

    def __init__(self, tags: Iterable[Tag], center_frequency_hz: float) -> None:
        self._on_dc = sorted(
            tag.tag_id
            for tag in tags
            if abs(tag.frequency_hz - center_frequency_hz) <= _ON_DC_HZ
        )
        self._next_ns: int | None = None
        self._seen: dict[str, int] = {}

    def check(self, block: IQBlock) -> list[str]:
        """Check a block if a check is due; return messages about new faults."""
        due = self._next_ns is None or not 0 < self._next_ns - block.time_ns <= _EVERY_NS
        samples = block.samples[:_EXAMINED_SAMPLES]
        if not due or len(samples) < _FEWEST_SAMPLES:
            return []
        self._next_ns = block.time_ns + _EVERY_NS
        faults = set(self._faults(np.ascontiguousarray(samples)))
        new = []
        for fault in (*self._seen, *(faults - set(self._seen))):
            count = self._seen.get(fault, 0)
            if count < _CONSECUTIVE_CHECKS:
                self._seen[fault] = count = count + 1 if fault in faults else 0
                if count == _CONSECUTIVE_CHECKS:
                    new.append(fault)
        return new

    def _faults(self, samples: NDArray[np.complex64]) -> Iterator[str]:
        parts = samples.view(np.float32).reshape(-1, 2)
        about_mean = parts - parts.mean(axis=0)
        power = np.square(about_mean, dtype=np.float64).mean(axis=0)
        if not np.isfinite(power).all() or not power.any():
            return  # other checks report non-finite values and silence
        middle = (np.abs(about_mean) < _EMPTY_MIDDLE).any(axis=0)
        if not middle.all():
            yield WRONG_FORMAT
        elif power.max() > _UNEQUAL_RATIO * power.min():
            yield UNEQUAL
        elif _most_common(parts[:, 0]) > _SAME_LEVEL:
            yield GAIN_TOO_LOW
        elif _clipped_share(parts) > _CLIPPED_SHARE:
            yield GAIN_TOO_HIGH
        mean = samples.mean()
        noise = float(np.mean(np.abs(samples - mean) ** 2)) / len(samples)
        if self._on_dc and abs(mean) ** 2 > _DC_RATIO * noise:
            ids = ", ".join(map(str, self._on_dc[:5]))
            yield f"Tag {ids} lies on the radio's DC line: tune 10 kHz away"


def _clipped_share(parts: NDArray[np.float32]) -> float:
    """Share of sample values at full scale; 0 for computed samples, which have no full
    scale.
    """
    size = np.abs(parts)
    computed = float(size.max()) > COMPUTED_AMPLITUDE
    return 0.0 if computed else float(np.mean(size >= CLIPPED_AMPLITUDE))


def _most_common(values: NDArray[np.float32]) -> float:
    return float(np.unique(values, return_counts=True)[1].max()) / values.size
