"""Imported before numpy: its linear algebra shall use one thread, and the vectors there are.

Blocks are small. A second thread saves nothing and costs more than all of the detection, for it
waits in a loop for the next product (reference/perf.md §0: 161 % of a core against 99 %).

OpenBLAS runs its kernels for Haswell, with vectors of 256 bits, on AMD processors that have
512: told which to take, the products of the detectors and of the decimator take half the time.
"""

import os
from pathlib import Path

_SKYLAKE = {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"}
"""What OpenBLAS's kernels for Skylake-X need."""

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")


def name_the_core(cpuinfo: Path = Path("/proc/cpuinfo")) -> None:
    """Choose OpenBLAS's kernels where it would choose lesser ones."""
    try:
        with cpuinfo.open(encoding="ascii", errors="replace") as lines:
            flags = next((line for line in lines if line.startswith("flags")), "")
    except OSError:
        return
    if set(flags.split()) >= _SKYLAKE:
        os.environ.setdefault("OPENBLAS_CORETYPE", "SkylakeX")


name_the_core()
