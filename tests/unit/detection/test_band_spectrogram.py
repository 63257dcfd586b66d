"""The spectrogram of a band: as defined, with the compiled kernels and without."""

import numpy as np
import pytest

from uavrt.core.runtime import native
from uavrt.detection.beeps.band_spectrogram import BandSpectrogram


@pytest.mark.usefixtures("processor")
@pytest.mark.parametrize(
    ("rate_hz", "share", "windows"),
    [(375e3, 0.45, 9), (250e3, 0.5, 4), (13_333.0, 0.3, 17), (1000.0, 0.45, 1), (22e3, 0.5, 3)],
)
def test_powers_are_those_of_windows_with_and_without_kernels(
    rate_hz: float, share: float, windows: int
) -> None:
    spectrogram = BandSpectrogram(
        sample_rate_hz=rate_hz, low_hz=-share * rate_hz, high_hz=share * rate_hz
    )
    length, hop = spectrogram.length, spectrogram.hop
    parts = np.random.default_rng(4).standard_normal((hop * (windows - 1) + length + 5, 2))
    samples = parts.astype(np.float32).view(np.complex64).ravel()
    taper = np.hanning(length + 2)[1:-1]
    at = np.arange(length)
    rows = np.linspace(0, spectrogram.bins - 1, 7).astype(int)
    frequencies = (spectrogram.low_hz + spectrogram.step_hz * rows) / rate_hz
    waves = np.exp(-2j * np.pi * frequencies[:, None] * at)
    expected = [
        np.abs(waves @ (taper * samples[hop * n : hop * n + length])) ** 2
        for n in range(windows)
    ]
    out, by_numpy = np.zeros((2, windows, spectrogram.bins), np.float32)
    spectrogram.powers(samples, out)
    with native.numpy_only():
        spectrogram.powers(samples, by_numpy)
    level = float(by_numpy.mean())
    assert np.abs(out - by_numpy).max() < 1e-4 * level
    assert np.abs(out[:, rows] - expected).max() < 1e-3 * level
