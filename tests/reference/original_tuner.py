"""The original's search for a radio frequency, over our cost function."""

import numpy as np
from numpy.typing import NDArray

from uavrt.dsp.tuner import compatible_candidates, compatible_cost


def original_center(
    tags: NDArray[np.float64], spacing_hz: float = 3750.0, *, by_offset: bool = False
) -> float:
    """Of the cheapest the one nearest to the tags' mean (``tuner.py``), or with the least mean
    distance from channel centres (``updated_tuner.py``)."""
    candidates = compatible_candidates(tags, spacing_hz, 100)
    cost = compatible_cost(tags, candidates, spacing_hz=spacing_hz, channel_count=100)
    last = cost.mean_offset_hz if by_offset else np.abs(candidates - tags.mean())
    # lexsort is stable: of equals the lowest frequency, as in the original.
    order = np.lexsort((last.round(6), cost.edge_cost.round(9), cost.tags_per_channel.round(9)))
    return float(candidates[order[0]])
