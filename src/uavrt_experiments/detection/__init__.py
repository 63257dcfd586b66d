"""What the detector can do, measured: signals, trials, and the tables of the claims."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.detection.campaign import run_experiments
    from uavrt_experiments.detection.cases import FULL_TRIALS, Case, Experiment
    from uavrt_experiments.detection.catalogue import EXPERIMENTS
    from uavrt_experiments.detection.interference import coloured_noise
    from uavrt_experiments.detection.plots import draw_all, require_matplotlib
    from uavrt_experiments.detection.signals import (
        START_NS,
        THESIS_TAG,
        TruePulse,
        add_pulse,
        noise,
    )
    from uavrt_experiments.detection.tables import (
        FOLDERS,
        RESULTS,
        Origin,
        Results,
        as_json,
        read_results,
        write_results,
    )
    from uavrt_experiments.result import Row

__all__ = [
    "EXPERIMENTS",
    "FOLDERS",
    "FULL_TRIALS",
    "RESULTS",
    "START_NS",
    "THESIS_TAG",
    "Case",
    "Experiment",
    "Origin",
    "Results",
    "Row",
    "TruePulse",
    "add_pulse",
    "as_json",
    "coloured_noise",
    "draw_all",
    "noise",
    "read_results",
    "require_matplotlib",
    "run_experiments",
    "write_results",
]
__getattr__ = lazily(
    __name__,
    {
        "Case": "cases",
        "EXPERIMENTS": "catalogue",
        "Experiment": "cases",
        "FOLDERS": "tables",
        "FULL_TRIALS": "cases",
        "Origin": "tables",
        "RESULTS": "tables",
        "Results": "tables",
        "Row": "uavrt_experiments.result",
        "START_NS": "signals",
        "THESIS_TAG": "signals",
        "TruePulse": "signals",
        "add_pulse": "signals",
        "as_json": "tables",
        "coloured_noise": "interference",
        "draw_all": "plots",
        "noise": "signals",
        "read_results": "tables",
        "require_matplotlib": "plots",
        "run_experiments": "campaign",
        "write_results": "tables",
    },
)
