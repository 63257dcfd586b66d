"""Create the searches for a tag's rates, each with its thresholds."""

import math

from uavrt.core.messages import Tag
from uavrt.detection.search.anchors import AnchorSearch
from uavrt.detection.search.grid import Grid
from uavrt.detection.search.hypotheses import RateSearch, jitter_reach
from uavrt.detection.search.long_groups import LongSearch
from uavrt.detection.search.null_lattices import counted_cell_limit
from uavrt.detection.search.thresholds import (
    begun_within_s,
    decision_interval_s,
    decision_span_s,
    effective_hypotheses,
    finer_times,
    group_tail,
    spread,
    threshold,
)
from uavrt.detection.search.tuning import GROUPS, NULL, THRESHOLDS


def make_searches(tag: Tag, grid: Grid, frequency_window_hz: float) -> list[RateSearch]:
    """Create one search for each of the tag's pulse rates, with its thresholds."""
    bandwidth = min(2.0 * frequency_window_hz, grid.sample_rate_hz)
    searches: list[RateSearch] = []
    kind = LongSearch if tag.k >= GROUPS.long_from_k else AnchorSearch
    for rate, interval_s in enumerate(tag.pulse_intervals_s, start=1):
        reach_s = jitter_reach(tag.interval_jitter_s, grid.hop_s) * grid.hop_s
        interval_time_s = decision_interval_s(tag, rate)
        first_s = decision_span_s(tag, rate)
        begun_s = THRESHOLDS.first_share * min(begun_within_s(tag, rate), interval_time_s)
        expected = tag.false_alarm_probability / len(tag.pulse_intervals_s)
        some = spread(tag, reach_s=reach_s)
        steady, first = (
            threshold(
                k=tag.k,
                hypotheses=effective_hypotheses(
                    k=tag.k,
                    bandwidth_hz=bandwidth,
                    time_s=time_s,
                    pulse_width_s=tag.pulse_width_s,
                    uncertainty_s=tag.interval_uncertainty_s,
                    reach_s=reach_s,
                    finer=finer_times(tag),
                ),
                spread=some,
                expected_false=expected,
            )
            for time_s in (interval_time_s, begun_s)
        )
        search = kind(
            rows=grid.rows,
            hop_s=grid.hop_s,
            interval_s=interval_s,
            uncertainty_s=tag.interval_uncertainty_s,
            jitter_s=tag.interval_jitter_s,
            k=tag.k,
            threshold=steady,
            rate=rate,
            first_threshold=first,
            first_columns=math.ceil(first_s / grid.hop_s),
        )
        if isinstance(search, AnchorSearch):
            limit = counted_cell_limit(tag.k, steady)
            counted = group_tail(tag.k, some, NULL.counted_share * steady, limit)
            at_level = counted / group_tail(tag.k, some, steady)
            search.count_null(
                expected / interval_time_s * grid.hop_s * at_level, interval_s / grid.hop_s
            )
        searches.append(search)
    return searches
