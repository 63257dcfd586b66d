"""Other people's filters, where they are installed; only run, never part of the product."""

import ctypes
import ctypes.util
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.complex64]
POINTER = ctypes.c_void_p

# liquid's analyzer takes one frame a call; a loop in C spares it the cost of 3750 Python calls.
LOOP = """
extern int firpfbch_crcf_analyzer_execute(void *, void *, void *);
void frames(void *bank, char *in, char *out, unsigned count, unsigned channels)
{
    for (unsigned n = 0; n < count; n++)
        firpfbch_crcf_analyzer_execute(bank, in + 8ul * n * channels, out + 8ul * n * channels);
}
"""


def csdr_decimator(
    factor: int, taps: NDArray[np.float32]
) -> Callable[[Samples], object] | None:
    """In-process ``fir_decimate_cc`` of libcsdr, or None where it is not installed."""
    path = ctypes.util.find_library("csdr")
    if path is None:
        return None
    function = ctypes.CDLL(path).fir_decimate_cc
    function.argtypes = [POINTER, POINTER, ctypes.c_int, ctypes.c_int, POINTER, ctypes.c_int]

    def run(samples: Samples) -> object:
        out = np.empty(samples.size // factor, dtype=np.complex64)
        return function(
            samples.ctypes.data,
            out.ctypes.data,
            samples.size,
            factor,
            taps.ctypes.data,
            taps.size,
        )

    return run


def liquid_decimator(
    factor: int, taps: NDArray[np.float32]
) -> Callable[[Samples], object] | None:
    """``firdecim_crcf`` of liquid-dsp, or None where it is not installed."""
    path = ctypes.util.find_library("liquid")
    if path is None:
        return None
    library = ctypes.CDLL(path)
    library.firdecim_crcf_create.restype = POINTER
    library.firdecim_crcf_create.argtypes = [ctypes.c_uint, POINTER, ctypes.c_uint]
    library.firdecim_crcf_execute_block.argtypes = [POINTER, POINTER, ctypes.c_uint, POINTER]
    filter_ = library.firdecim_crcf_create(factor, taps.ctypes.data, taps.size)

    def run(samples: Samples) -> object:
        count = samples.size // factor
        out = np.empty(count, dtype=np.complex64)
        return library.firdecim_crcf_execute_block(
            filter_, samples.ctypes.data, count, out.ctypes.data
        )

    return run


def liquid_bank(channels: int, half_length: int) -> Callable[[Samples], object] | None:
    """``firpfbch_crcf`` analyzer of liquid-dsp, or None without it or a C compiler.

    Kaiser prototype, ``2 * half_length`` taps per channel, 80 dB; critically sampled.
    """
    path, compiler = ctypes.util.find_library("liquid"), shutil.which("cc")
    if path is None or compiler is None:
        return None
    with tempfile.TemporaryDirectory() as directory:
        source, target = Path(directory, "loop.c"), Path(directory, "loop.so")
        source.write_text(LOOP)
        command = [
            compiler,
            "-O2",
            "-shared",
            "-fPIC",
            str(source),
            "-o",
            str(target),
            f"-l:{path}",
        ]
        if subprocess.run(command, check=False, capture_output=True).returncode:
            return None
        library, loop = ctypes.CDLL(path), ctypes.CDLL(str(target))
    create = library.firpfbch_crcf_create_kaiser
    create.restype = POINTER
    create.argtypes = [ctypes.c_int, ctypes.c_uint, ctypes.c_uint, ctypes.c_float]
    loop.frames.argtypes = [POINTER, POINTER, POINTER, ctypes.c_uint, ctypes.c_uint]
    analyzer = 0
    bank = create(analyzer, channels, half_length, 80.0)

    def run(samples: Samples) -> object:
        out = np.empty(samples.size, dtype=np.complex64)
        return loop.frames(
            bank, samples.ctypes.data, out.ctypes.data, samples.size // channels, channels
        )

    return run
