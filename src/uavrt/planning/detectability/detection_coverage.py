"""Compute the probability that a tag at each map cell is detected along a path.

The expected pulses are divided into groups of K, the number that the detector sums. Link
budget, antenna pattern and terrain give a group's mean energy, which determines the probability
that the detector finds it. The error of the tag's assumed power is common to all pulses. So the
probability of missing all groups is computed for each possible error and then averaged.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.core.runtime.lean_scipy import special
from uavrt.detection.sensitivity import detection_probability
from uavrt.localization.antenna import MONOPOLE, AntennaPattern, monopole_gain_db
from uavrt.localization.headings import Headings
from uavrt.localization.terrain.squares import GroundGrid
from uavrt.localization.terrain.viewshed import terrain_loss_map
from uavrt.planning.detectability.link_budget import LinkBudget
from uavrt.planning.detectability.whole_flight_chance import MODEL, WholeFlightSum
from uavrt.planning.tuning import PLANNING

_Floats = NDArray[np.float64]
_Singles = NDArray[np.float32]
_GROUP_ENR_DB = np.arange(-15.0, 35.25, 0.25)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AntennaPath:
    """Positions and headings of the antenna at each pulse expected along a path."""

    time_s: _Floats
    """Times of the expected pulses [s], ascending, shape (n,)."""
    east_m: _Floats
    """East coordinate of the antenna [m], shape (n,), at each expected pulse."""
    north_m: _Floats
    height_m: _Floats
    """Height of the antenna above the ground below it [m], shape (n,)."""
    headings: Headings | None = None
    """Headings of the antenna; None if its gain is equal in all directions."""
    noise_db: _Floats | None = None
    """Noise at each pulse relative to the link budget's [dB], shape (n,); None if equal."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coverage:
    """Detection probability of a tag for each cell of a map."""

    ground: GroundGrid
    heard: _Singles
    """Detection probability, shape (rows, columns), southern row first; NaN where the ground
    height is unknown."""
    groups: int
    """Number of pulse groups (of K pulses each) along the path; 1 or 0 if `whole_flight`."""
    whole_flight: bool = False
    """True if all pulses of the flight are combined, as by `uavrt integrate`."""
    limitations: tuple[str, ...] = ()
    """Sentences on effects that the coverage does not include, such as hills."""

    @property
    def mean(self) -> float:
        """Mean detection probability over all cells of known ground height; NaN if there are
        none.
        """
        known = self.heard[np.isfinite(self.heard)]
        return float(known.mean()) if known.size else math.nan

    @property
    def known_km2(self) -> float:
        """Area of the cells of known ground height [km²], on which the mean and the shares are
        based.
        """
        return float(np.isfinite(self.heard).sum()) * self.ground.cell_m**2 / 1e6

    def share_above(self, probability: float) -> float:
        """Share of the cells of known ground height whose detection probability is at least
        `probability`.
        """
        known = self.heard[np.isfinite(self.heard)]
        return float((known >= probability).mean()) if known.size else math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Absence:
    """Probability that a tag which was not detected is absent from an area."""

    prior: float
    """Probability before the flight that the tag is in the area."""
    heard: float
    """Probability, averaged over the area, that the flight would have detected the tag."""
    not_here: float
    """Posterior probability that the undetected tag is outside the area."""


def planned_antenna_path(
    corners_m: list[tuple[float, float]],
    *,
    height_m: float,
    speed_m_s: float,
    interval_s: float,
    nose_first: bool = False,
) -> AntennaPath:
    """Return the antenna's position at the time of each pulse on straight paths between
    corners; with `nose_first` also its direction, along the path.
    """
    points = np.array(corners_m, np.float64)
    legs = np.hypot(*np.diff(points, axis=0).T)
    gone = np.concatenate(([0.0], np.cumsum(legs)))
    count = max(1, int(gone[-1] / (speed_m_s * interval_s)) + 1)
    time_s = interval_s * np.arange(count, dtype=np.float64)
    at = time_s * speed_m_s
    course = np.degrees(np.arctan2(*np.diff(points, axis=0).T)) if len(points) > 1 else [0.0]
    leg = np.clip(np.searchsorted(gone, at, side="right") - 1, 0, max(len(points) - 2, 0))
    return AntennaPath(
        time_s=time_s,
        east_m=np.interp(at, gone, points[:, 0]),
        north_m=np.interp(at, gone, points[:, 1]),
        height_m=np.full(count, height_m),
        headings=Headings.level(np.asarray(course)[leg]) if nose_first else None,
    )


def coverage_of(
    ground: GroundGrid,
    way: AntennaPath,
    tag: Tag,
    budget: LinkBudget,
    *,
    pattern: AntennaPattern | None = None,
    level_sigma_db: float = 3.0,
    frequency_window_hz: float = 500.0,
    hills: bool = True,
    whole_flight: bool = False,
    most_drift: float = 0.0,
    on_pulse: Callable[[int, int], None] | None = None,
) -> Coverage:
    """Compute for each map cell the probability that a tag there is detected along a path.

    `ground`: its cells are the possible positions of the tag. `way`: position of the antenna at
    each pulse. `tag`: its K, interval and false-alarm probability determine the threshold.
    `budget`: link budget; its height is replaced by that of the path. `pattern`: antenna
    pattern, combined with the path's headings; without it, the gain is equal in all directions.
    `level_sigma_db`: standard deviation of the tag's level, common to all pulses.
    `frequency_window_hz`: half-width of the search around the tag's frequency. `hills`: False
    for level ground. `whole_flight`: combine all pulses, as `uavrt integrate` does.
    `most_drift`: largest searched change of the interval over the flight. `on_pulse`: called
    with the number of finished pulses and their total.
    """
    errors_db, weights = special.roots_hermitenorm(PLANNING.level_nodes)
    weights = weights / weights.sum()
    view = _View(ground, budget, pattern, way, hills=hills)
    if whole_flight:
        levels_db = level_sigma_db * errors_db
        each = _by_whole_flight(
            view,
            WholeFlightSum(
                tag, len(way.time_s), frequency_window_hz, levels_db, most_drift=most_drift
            ),
            len(way.time_s),
            on_pulse,
        )
        heard = np.einsum("e,eyx->yx", weights, each)
        return Coverage(
            ground=ground,
            heard=np.where(ground.known, heard, np.nan).astype(np.float32),
            groups=int(len(way.time_s) >= MODEL.least_pulses),
            whole_flight=True,
        )
    found = _found_by_enr(tag, frequency_window_hz)
    missed = np.zeros((PLANNING.level_nodes, *ground.height_m.shape), np.float32)
    groups, summed = 0, np.zeros(ground.height_m.shape, np.float32)
    for pulse in range(len(way.time_s)):
        summed += view.energies(pulse)
        if pulse % tag.k == tag.k - 1:
            groups += 1
            enr_db = 10.0 * np.log10(np.maximum(summed / tag.k, 1e-6))
            for number, error in enumerate(errors_db):
                at = (enr_db + (level_sigma_db * error - _GROUP_ENR_DB[0])) * 4.0
                row = np.clip(at + 0.5, 0, len(found) - 1).astype(np.int32)
                missed[number] += found[row]
            summed[:] = 0.0
        if on_pulse is not None:
            on_pulse(pulse + 1, len(way.time_s))
    heard = 1.0 - np.einsum("e,eyx->yx", weights, np.exp(missed))
    heard = np.where(ground.known, np.clip(heard, 0.0, 1.0), np.nan).astype(np.float32)
    return Coverage(ground=ground, heard=heard, groups=groups)


def _by_whole_flight(
    view: "_View",
    judged: WholeFlightSum,
    pulses: int,
    on_pulse: Callable[[int, int], None] | None,
) -> _Floats:
    """Probability of a detection from all pulses of a flight together, shape (errors, rows,
    columns).
    """
    for number in range(2 * pulses):
        step = judged.look if number < pulses else judged.add
        step(view.energies(number % pulses))
        if on_pulse is not None:
            on_pulse(number + 1, 2 * pulses)
    return judged.found() if pulses >= MODEL.least_pulses else 0.0 * judged.found()


def absence(coverage: Coverage, inside: NDArray[np.bool_], prior: float | None) -> Absence:
    """Return the probability that an undetected tag is not in a part of the map.

    `coverage` is that of a flight without a detection of the tag. `inside` (rows, columns) is
    True in the part. `prior` is the prior probability that the tag is in the part; None means
    that the tag is equally likely anywhere on the map. In cells of unknown ground height, the
    detection probability counts as 0.
    """
    missed = 1.0 - np.nan_to_num(coverage.heard.astype(np.float64), nan=0.0)
    here = float(missed[inside].mean()) if inside.any() else 1.0
    share = float(inside.mean()) if prior is None else prior
    outside = ~inside
    elsewhere = float(missed[outside].mean()) if prior is None and outside.any() else 1.0
    total = share * here + (1.0 - share) * elsewhere
    still = share * here / total if total > 0.0 else share
    return Absence(prior=share, heard=1.0 - here, not_here=1.0 - still)


@lru_cache(maxsize=64)
def _found_by_enr(tag: Tag, frequency_window_hz: float) -> _Singles:
    """Log probability of missing a group of pulses, by ENR in steps of 0.25 dB."""
    found = [
        detection_probability(tag, float(enr), frequency_window_hz=frequency_window_hz)
        for enr in _GROUP_ENR_DB
    ]
    return np.log(np.maximum(1.0 - np.array(found), 1e-12)).astype(np.float32)


class _View:
    """Computes the received energy of a pulse for tags at all cells, again only after the drone
    has moved.
    """

    def __init__(
        self,
        ground: GroundGrid,
        budget: LinkBudget,
        pattern: AntennaPattern | None,
        way: AntennaPath,
        *,
        hills: bool,
    ) -> None:
        self._ground, self._budget, self._way, self._hills = ground, budget, way, hills
        self._upright = pattern is not None and pattern.name == MONOPOLE
        self._pattern = None if self._upright or way.headings is None else pattern
        self._level: _Singles | None = None
        self._at = (math.inf, math.inf, math.inf)
        self._towards: tuple[_Singles, _Singles, _Singles] | None = None

    def energies(self, pulse: int) -> _Singles:
        way = self._way
        at = (way.east_m[pulse], way.north_m[pulse], way.height_m[pulse])
        if (
            max(abs(a - b) for a, b in zip(at, self._at, strict=True))
            > 0.25 * self._ground.cell_m
        ):
            self._move(*at)
        assert self._level is not None
        level = self._level
        if self._pattern is not None:
            level = level + self._gain_db(pulse, self._pattern)
        if way.noise_db is not None:
            level = level - np.float32(way.noise_db[pulse])
        return np.asarray(np.exp(level * np.float32(math.log(10.0) / 10.0)))

    def _move(self, east_m: float, north_m: float, height_m: float) -> None:
        ground = self._ground
        self._at = (east_m, north_m, height_m)
        dx = (ground.east_m - east_m)[np.newaxis, :].astype(np.float32)
        dy = (ground.north_m - north_m)[:, np.newaxis].astype(np.float32)
        over = np.sqrt(dx * dx + dy * dy)
        beneath = float(ground(np.array([east_m]), np.array([north_m]))[0])
        rise = np.float32(beneath) - ground.height_m
        budget = replace(self._budget, drone_height_m=height_m)
        level = budget.enr_db(over, rise_m=rise).astype(np.float32)
        if self._hills:
            level -= terrain_loss_map(
                ground,
                east_m=east_m,
                north_m=north_m,
                antenna_m=height_m,
                tag_m=budget.tag_height_m,
                frequency_hz=budget.frequency_hz,
            )
        self._level = np.maximum(level, np.float32(PLANNING.no_level_db))
        down = np.float32(height_m - budget.tag_height_m) + rise
        slant = np.maximum(np.sqrt(over * over + down * down), np.float32(1.0))
        if self._upright:
            below_deg = np.degrees(np.arcsin(np.clip(down / slant, -1.0, 1.0)))
            self._level += monopole_gain_db(below_deg).astype(np.float32)
        if self._pattern is not None:
            self._towards = (dy / slant, dx / slant, down / slant)

    def _gain_db(self, pulse: int, pattern: AntennaPattern) -> _Singles:
        assert self._way.headings is not None
        assert self._towards is not None
        headings = self._way.headings
        if headings.axes is not None:
            axes = headings.axes[pulse].astype(np.float32)
        else:
            yaw = math.radians(float(headings.yaw_deg[pulse]))
            c, s = math.cos(yaw), math.sin(yaw)
            axes = np.array(((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)), np.float32)
        north, east, down = self._towards
        forward, right, below = (
            axes[row, 0] * north + axes[row, 1] * east + axes[row, 2] * down for row in range(3)
        )
        return pattern.gain_towards_db(forward, right, below).astype(np.float32)
