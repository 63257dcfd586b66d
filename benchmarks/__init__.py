"""Speed of every stage: ``python -m benchmarks [SECTION ...]``.

Each ``bench_<section>.py`` has ``run() -> list[Table]``; the tables of a section replace that
section in ``results.md``, the others stay. See `benchmarks.harness`.
"""

import os

# One core, as on the drone; a BLAS reads these when NumPy is first imported.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import uavrt.cli.shown.one_thread  # noqa: E402, F401  the same kernels as `uavrt detect`
