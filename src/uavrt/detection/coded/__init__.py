"""Detect the bursts of coded tags, many codes of one channel at once.

`cells` makes the energies that all codes share, `sums` adds them up at the gaps of each code,
`judging` says whether a sum is a burst and whose, `detector` is the stage.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.detection.coded.cells import Cells
    from uavrt.detection.coded.detector import CodedDetector
    from uavrt.detection.coded.limits import FALSE_PER_HOUR, sum_limit

__all__ = ["FALSE_PER_HOUR", "Cells", "CodedDetector", "sum_limit"]
__getattr__ = lazily(
    __name__,
    {
        "FALSE_PER_HOUR": "limits",
        "Cells": "cells",
        "CodedDetector": "detector",
        "sum_limit": "limits",
    },
)
