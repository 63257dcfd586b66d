"""What judging whole flights reaches, measured: false alarms, range, place, cost."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.integrate.catalogue import EXPERIMENTS, FOLDERS, run_all

__all__ = ["EXPERIMENTS", "FOLDERS", "run_all"]
__getattr__ = lazily(
    __name__, {"EXPERIMENTS": "catalogue", "FOLDERS": "catalogue", "run_all": "catalogue"}
)
