"""An example of what other packages can add to uavrt: docs/how-to/extend.md."""

import time

import numpy as np

from uavrt.config.settings import RadioSettings
from uavrt.core.clock import Clock
from uavrt.core.messages import IQBlock
from uavrt.localization import (
    AntennaPattern,
    Bearing,
    BearingData,
    Position,
    PowerTrack,
    Stations,
)

LOOP = AntennaPattern(name="toy loop", e_plane_db=(0.0, -1.2, -6.0, -30.0, -6.0, -1.2, -0.5))


def mean_direction(data: BearingData) -> Bearing:
    """Estimate a bearing as the mean of all headings, weighted with the power."""
    heard = ~np.isnan(data.matched_power)
    weight = np.maximum(data.matched_power[heard] - 1.0, 0.0) * data.noise_psd[heard]
    toward = weight @ np.exp(1j * np.radians(data.yaw_deg[heard]))
    return Bearing(
        bearing_deg=float(np.degrees(np.angle(toward)) % 360.0),
        method="toy_mean",
        pulses=int(heard.sum()),
    )


def middle(stations: Stations | None, powers: PowerTrack | None) -> Position:
    """Estimate a position as the middle of where anything was heard."""
    where = stations if stations is not None else powers
    assert where is not None
    return Position(
        latitude_deg=float(np.mean(where.latitude_deg)),
        longitude_deg=float(np.mean(where.longitude_deg)),
        method="toy_middle",
        stations=0 if stations is None else len(stations.bearing_deg),
    )


class Beeper:
    """A radio that hears noise, and a pulse of 20 ms twice a second, 10 kHz off its centre."""

    def __init__(self, sample_rate_hz: float, center_frequency_hz: float, clock: Clock) -> None:
        self.sample_rate_hz = sample_rate_hz
        self.center_frequency_hz = center_frequency_hz
        self.total_samples = None
        self._clock = clock
        self._start_ns = clock.now_ns()
        self._next = 0
        self._rng = np.random.default_rng(1)

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Give a tenth of a second when it is over."""
        count = round(self.sample_rate_hz / 10)
        due_ns = self._start_ns + round((self._next + count) / self.sample_rate_hz * 1e9)
        wait_s = (due_ns - self._clock.now_ns()) / 1e9
        if timeout_s is not None and wait_s > timeout_s:
            time.sleep(timeout_s)
            return None
        time.sleep(max(0.0, wait_s))
        index = self._next + np.arange(count)
        parts = self._rng.normal(0.0, 0.01, (2, count))
        tone = np.exp(2j * np.pi * 10_000.0 * index / self.sample_rate_hz)
        beeping = index / self.sample_rate_hz % 0.5 < 0.02
        samples = parts[0] + 1j * parts[1] + 0.02 * beeping * tone
        first, self._next = self._next, self._next + count
        return IQBlock(
            samples=samples.astype(np.complex64),
            sample_index=first,
            time_ns=self._start_ns + round(first / self.sample_rate_hz * 1e9),
            sample_rate_hz=self.sample_rate_hz,
        )

    def close(self) -> None:
        """Nothing to close."""


def open_beeper(
    settings: RadioSettings, center_frequency_hz: float, clock: Clock | None
) -> Beeper:
    """Open the radio as ``[radio] kind = "toy_beeper"`` asks for it."""
    return Beeper(settings.sample_rate_hz, center_frequency_hz, clock or Clock.start())
