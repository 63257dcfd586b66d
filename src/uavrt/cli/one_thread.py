"""Imported before numpy: its linear algebra shall use one thread.

Blocks are small. A second thread saves nothing and costs more than all of the detection, for it
waits in a loop for the next product (reference/perf.md §0: 161 % of a core against 99 %).
"""

import os

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
