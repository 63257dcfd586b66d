"""Search the time-frequency grid for groups of pulses.

`grid` and `spectra` compute the cells; `noise` and `levelling` estimate the noise in them.
`anchors` and `long_groups` search them as `hypotheses` describes, against `thresholds`. `band`
holds one of each for a tag; `evidence` weighs candidates just above the threshold.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.detection.search.band import SearchBand, advance_together
    from uavrt.detection.search.evidence import Evidence, gate
    from uavrt.detection.search.grid import (
        ROWS_PER_BIN,
        Grid,
        Spectrogram,
        make_grid,
        sliding_maximum,
    )
    from uavrt.detection.search.hypotheses import (
        CELL_LIMIT,
        Candidate,
        RateSearch,
        jitter_reach,
    )
    from uavrt.detection.search.known_pulses import KnownPulses
    from uavrt.detection.search.levelling import Leveller
    from uavrt.detection.search.spectra import Workspace
    from uavrt.detection.search.thresholds import (
        decision_interval_s,
        decision_span_s,
        effective_hypotheses,
        group_tail,
        spread,
        threshold,
    )

__all__ = [
    "CELL_LIMIT",
    "ROWS_PER_BIN",
    "Candidate",
    "Evidence",
    "Grid",
    "KnownPulses",
    "Leveller",
    "RateSearch",
    "SearchBand",
    "Spectrogram",
    "Workspace",
    "advance_together",
    "decision_interval_s",
    "decision_span_s",
    "effective_hypotheses",
    "gate",
    "group_tail",
    "jitter_reach",
    "make_grid",
    "sliding_maximum",
    "spread",
    "threshold",
]
__getattr__ = lazily(
    __name__,
    {
        "CELL_LIMIT": "hypotheses",
        "Candidate": "hypotheses",
        "Evidence": "evidence",
        "Grid": "grid",
        "KnownPulses": "known_pulses",
        "Leveller": "levelling",
        "ROWS_PER_BIN": "grid",
        "RateSearch": "hypotheses",
        "SearchBand": "band",
        "Spectrogram": "grid",
        "Workspace": "spectra",
        "advance_together": "band",
        "decision_interval_s": "thresholds",
        "decision_span_s": "thresholds",
        "effective_hypotheses": "thresholds",
        "gate": "evidence",
        "group_tail": "thresholds",
        "jitter_reach": "hypotheses",
        "make_grid": "grid",
        "sliding_maximum": "grid",
        "spread": "thresholds",
        "threshold": "thresholds",
    },
)
