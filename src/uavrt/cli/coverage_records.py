"""Arguments and results of ``uavrt coverage``."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uavrt.errors import ConfigError

if TYPE_CHECKING:
    from uavrt.messages import Tag
    from uavrt.planning.coverage import Absence, Coverage
    from uavrt.planning.link_budget import LinkBudget
    from uavrt.recording.integrated import SilentAround
    from uavrt.terrain.elevation import Elevation


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """Command-line arguments."""

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
    """The map of one tag at one height, and derived values."""

    tag: "Tag"
    height_m: float | None
    """None: the flight's own."""
    coverage: "Coverage"
    best: bool = True
    in_area: float | None = None
    """Mean probability in the outline."""
    absence: "Absence | None" = None
    heard: int = 0
    antenna: str
    in_hindsight: bool = False
    """True if judging the whole flight found the tag."""
    silent: "SilentAround | None" = None
    """Coverage around a flight; None where the tag was heard."""
    noise: str | None = None
    files: tuple[Path, ...] = ()


def chosen(known: "list[Tag]", ids: tuple[int, ...]) -> "list[Tag]":
    """Pick tags by their ids; raises `ConfigError` where one is unknown."""
    missing = sorted(set(ids) - {one.tag_id for one in known})
    if missing or not known:
        listed = ", ".join(str(one.tag_id) for one in known) or "none"
        what = f"there is no tag {missing[0]}" if missing else "there are no tags"
        raise ConfigError(what, remedy=f"Choose from {listed}, or name --tags")
    return [one for one in known if not ids or one.tag_id in ids]


def mean_inside(one: "Coverage", cells: Any) -> float:
    """Mean probability of cells whose ground is known."""
    import numpy as np

    known = one.heard[cells & np.isfinite(one.heard)]
    return float(known.mean()) if known.size else math.nan
