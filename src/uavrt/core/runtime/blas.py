"""Environment variables for NumPy's linear algebra, set before NumPy is imported.

The products of sample blocks are small, so a second thread saves no time. While it waits for
the next product it uses the processor: 161 % of a core in place of 99 %.

On AMD processors with vectors of 512 bits, OpenBLAS uses its kernels for Haswell, with 256
bits. With the wider kernels, the products of detectors and decimator take half as long.
"""

import os
from collections.abc import Mapping
from pathlib import Path

_SKYLAKE = {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"}
"""Processor features required by OpenBLAS's kernels for Skylake-X."""


def blas_environment(
    given: Mapping[str, str] = os.environ, cpuinfo: Path = Path("/proc/cpuinfo")
) -> dict[str, str]:
    """Environment variables to add to `given`; variables already in `given` are left out."""
    wanted = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}
    try:
        with cpuinfo.open(encoding="ascii", errors="replace") as lines:
            flags = next((line for line in lines if line.startswith("flags")), "")
    except OSError:
        flags = ""
    if set(flags.split()) >= _SKYLAKE:
        wanted["OPENBLAS_CORETYPE"] = "SkylakeX"
    return {name: value for name, value in wanted.items() if name not in given}
