"""Amplitudes of a pulse whose switch positions are known at each sample."""

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import UsageError

_Floats = NDArray[np.float64]
_Complex = NDArray[np.complex128]


def switched_amplitudes(
    samples: NDArray[np.complex64],
    selected: NDArray[np.intp],
    *,
    frequency_hz: float,
    sample_rate_hz: float,
    elements: int,
) -> tuple[_Complex, _Floats]:
    """Complex amplitude of a pulse at each position of the switch.

    `samples` (n,): the pulse, from its first to its last sample.
    `selected`: position of the switch at each sample; negative while it settles.
    `frequency_hz`: carrier of the pulse in the samples.
    `sample_rate_hz`: rate.
    `elements`: positions of the switch.
    Returns: `amplitudes` (elements,): common carrier phase.
    Returns: `counts`: samples behind each; its noise power is that of a sample over the count.
    Raises `UsageError`: a position was never selected during the pulse.
    """
    time = np.arange(len(samples)) / sample_rate_hz
    still = samples * np.exp(-2j * np.pi * frequency_hz * time)
    valid = selected >= 0
    counts = np.bincount(selected[valid], minlength=elements).astype(np.float64)
    if len(counts) != elements or not counts.all():
        raise UsageError(
            "the antenna switch does not reach every position during the pulse",
            remedy="Step it faster: every position several times in a pulse",
        )
    real = np.bincount(selected[valid], still.real[valid], elements)
    imaginary = np.bincount(selected[valid], still.imag[valid], elements)
    return np.asarray((real + 1j * imaginary) / counts), counts
