"""SigMF recordings with a gap, as a radio writes them whose crystal is not quite right."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.core.clock import iso_utc

GAP_S = 0.7
DRIFT_S = 0.18
"""What a crystal that is 50 ppm off is wrong by after an hour."""
KINDS = ("right", "slow", "fast", "uncounted", "counted anew", "times alone")


def write_gapped(
    base: Path,
    samples: NDArray[np.complex64],
    *,
    rate_hz: float,
    center_hz: float,
    start_ns: int,
    gap_s: tuple[float, float],
    kind: str = "slow",
    **about: Any,
) -> Path:
    """Leave out a stretch of samples that stand at their true times.

    Until the gap a slow radio has counted fewer samples than its nominal rate makes, a fast one
    more; one that knows nothing of the gap goes on counting, one that was opened again counts
    from 0.
    """
    begin, end = (round(each * rate_hz) for each in gap_s)
    drift_s = {"slow": -DRIFT_S, "fast": DRIFT_S, "uncounted": gap_s[0] - gap_s[1]}
    drift = round(drift_s.get(kind, 0.0) * rate_hz)
    first: dict[str, Any] = {"core:sample_start": 0, "core:frequency": center_hz}
    second = first | {"core:sample_start": begin}
    if kind != "times alone":
        first["core:global_index"] = 5000
        second["core:global_index"] = 0 if kind == "counted anew" else 5000 + end + drift
    first["core:datetime"] = iso_utc(start_ns)
    second["core:datetime"] = iso_utc(start_ns + round(end / rate_hz * 1e9))
    kept = np.concatenate((samples[:begin], samples[end:])).astype(np.complex64)
    kept.tofile(base.with_name(base.name + ".sigmf-data"))
    meta = {
        "global": {
            "core:datatype": "cf32_le",
            "core:sample_rate": rate_hz,
            "core:version": "1.2.0",
            **about,
        },
        "captures": [first, second],
        "annotations": [],
    }
    path = base.with_name(base.name + ".sigmf-meta")
    path.write_text(json.dumps(meta))
    return path
