"""Arguments and results of ``uavrt coverage``."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from uavrt.core.messages import Tag
    from uavrt.flight.integrated import SilentAround
    from uavrt.localization.terrain.elevation import Elevation
    from uavrt.planning.detectability.detection_coverage import Absence, Coverage
    from uavrt.planning.detectability.link_budget import LinkBudget


@dataclass(frozen=True, slots=True, kw_only=True)
class CoverageOptions:
    """All command-line arguments of ``uavrt coverage`` in one record."""

    source: Path
    elevation: "Elevation | None"
    outline: Path | None
    prior: float | None
    heights_m: tuple[float, ...]
    speed_m_s: float
    spacing_m: float
    margin_m: float
    cell_m: float | None
    antenna: str | None
    level_sigma_db: float
    budget: "LinkBudget"
    output: Path | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MappedTag:
    """Coverage map of one tag at one height, with values computed from it."""

    tag: "Tag"
    height_m: float | None
    """Flight height above ground [m]; None: heights of the actual flight."""
    coverage: "Coverage"
    best: bool = True
    in_area: float | None = None
    """Mean detection probability within the outline of --area; None if no area is given."""
    absence: "Absence | None" = None
    heard: int = 0
    antenna: str
    in_hindsight: bool = False
    """True if ``uavrt integrate`` found the tag in the whole flight."""
    silent: "SilentAround | None" = None
    """Area where an undetected tag would be detected; None for plans and detected tags."""
    noise: str | None = None
    files: tuple[Path, ...] = ()


def mean_inside(one: "Coverage", cells: Any) -> float:
    """Mean detection probability over the cells of known ground height in an outline."""
    import numpy as np

    known = one.heard[cells & np.isfinite(one.heard)]
    return float(known.mean()) if known.size else math.nan
