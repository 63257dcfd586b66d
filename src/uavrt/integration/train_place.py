"""Where the tag of a folded train is: the energies of its pulses against each place's gains.

A slot's energy in noise is the largest of m unit exponentials (m from their mean, as jitter and
slot make it); with a pulse of energy S two of them, the windows that hold most of it, are
noncentral chi-squares of 2 degrees of freedom (a constant amplitude of unknown phase). The
level is a nuisance with a flat prior in decibels, the place has one flat over the ground.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, ndimage, sparse, special, stats
from scipy.sparse import csgraph

from uavrt.integration.bursts import exponentials, log_ratio_parts
from uavrt.integration.drifting import train_times_s
from uavrt.integration.energy_grid import SlotEnergies
from uavrt.integration.places import (
    BEARING_STEP_DEG,
    EXPONENT,
    RANGE_STEP,
    Places,
    common_gains,
    east_north,
)
from uavrt.integration.rates import other_rate_logs
from uavrt.integration.whole_flight import FoldedTrain
from uavrt.tangent_plane import TangentPlane
from uavrt.units import wrap_degrees_180, wrap_degrees_360

_Floats = NDArray[np.float64]
_AMPLITUDES = np.arange(0.0, 80.0, 0.1)
"""Of pulses in noise: up to 38 dB."""
_STRENGTHS_DB = np.arange(-40.0, 44.0, 0.5)
_STEP_DB = 0.1
"""Between two strengths that are looked up: at half a decibel the pulses of a lane are rounded
alike, and places 20 m apart differ for that alone."""
_LEVELS_DB = (-14.0, 9.0)
"""Levels looked at, from the strongest energies."""
_LEVEL_PARTS = 8
"""Of a step between them."""
_FADING_DB = 1.0
"""Of single pulses, by what pattern, poses and ground do beyond the model."""
_LEAST_LOG = -30.0
_FINE = 3
"""Parts of a likely cell in bearing and distance."""
_MOST_FINED = 300
_ALWAYS_FINED = 60
"""The likeliest cells, however little they hold: between the middles of cells that are wide for
a loud tag, the likelihood varies by more than from one to the next."""
_EVEN = 2.0
"""Where log likelihoods differ by more among the parts of a cell, these are looked at in parts
again …"""
_FINEST_M = 3.0
"""… if they are larger than this: positions of the drone are not better."""
_MOST_ROUNDS = 4
_SHARPER = 8
"""Power of the belief whose mean is the likeliest place: of a normal one the same."""
_ALONE = 0.9
"""A part with so much is where the tag is; else the place is the middle of all."""
_WITHIN = 7
"""Points along each side of a cell over which its probability lies."""
_LIKELY = 100
"""Places by which a flight's share is told."""
_KEPT = 0.998
_BLOCK = 20_000
"""Places times pulses looked up at once."""
_BLOCK_OF_RATES = 300
"""Places whose slots are gone through at once."""
_ROWS = 200
"""Cells that are compared with all others at once."""
_BETWEEN_DB = 3.0
"""Of a tag's level from one flight to another: posture, receiver, ground."""
_EXPONENTS = (2.0, 2.5, 3.0, 3.5, 4.0)
"""Of the fall with distance, from free space to a tag on the ground beyond the break point."""
_EXPONENT_SHARES = np.diff(
    special.ndtr((np.array([-np.inf, 2.25, 2.75, 3.25, 3.75, np.inf]) - EXPONENT) / 0.7)
)
"""As `uavrt.localization.Propagation` believes in what is nearest to each. A quarter of that is
below free space, and counts for it: left out, tags that are seen freely seem farther away."""
_SAME_RANGE_DB = 0.3
"""Where a place was as far all the time, the exponent tells nothing."""
_COUNTED = 0.8
"""Of the pulses' evidence: what pattern, poses and ground do beyond the model is the same for
neighbouring pulses. With all of it regions of 90 % held .85 (I4)."""
_LASTING_DB2 = 8.0
"""Variance of that, times the pulses for which it lasts: where noise and fading of single
pulses are less, it limits what they say."""
_NOISY_DB2 = 10.0
"""Variance of a level in noise up to which `_COUNTED` holds."""
_LOUD_AS = 6.0
"""A loud pulse of energy E counts as this times ln E: 18 at the limit, 41 at 30 dB."""
_WINDOWS = (0.8, 0.6)
"""Parts of a pulse's energy in the windows that it lies in most: its start and frequency are
between those looked at. With all of it in one window pulses near the noise came out too strong,
so that a tag that was passed seemed farther away than it was."""
_LEAST_QUIET = 200
"""Slots without pulses from which the noise is taken."""
_LEAST_FALL = 0.02
"""Share of a fall with distance from which regions hold for it."""
_OUTLIER = 0.02
"""Share of the pulses that tell nothing: blocked, covered, a moved head."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceBelief:
    """Where a tag is, after a whole flight."""

    latitude_deg: float
    longitude_deg: float
    radius50_m: float
    radius95_m: float
    bearing_deg: float
    """From the middle of the flight."""
    arc50_deg: float
    """Width of the arc that holds half of the probability."""
    arc95_deg: float
    level_db: float
    """Energy over noise of the strongest pulse."""
    probability: _Floats
    """(places,)."""
    cells: "Cells"

    def arc_deg(self, share: float) -> float:
        """Width of the arc around the bearing that holds a share of the probability."""
        return self.cells.arc_deg(self.bearing_deg, share)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One of the places where a tag may be."""

    latitude_deg: float
    longitude_deg: float
    radius95_m: float
    """Holds 95 % of this part's probability."""
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Parts of the ground around the middle of a flight, and how likely the tag is in each."""

    plane: TangentPlane
    bearing_deg: _Floats
    """(cells,) middles."""
    range_m: _Floats
    width_deg: _Floats
    ratio: _Floats
    """Of a cell's farther border to its nearer one."""
    probability: _Floats
    by_fall: _Floats
    """(falls with distance, cells) the same if one of them were known."""

    @property
    def area(self) -> _Floats:
        """(cells,) ground, relative."""
        return _area(self.range_m, self.width_deg, self.ratio)

    def region(self, share: float) -> NDArray[np.bool_]:
        """Which cells hold a share of the probability, whatever the fall with distance is.

        For each fall they are the smallest such region. After a pass the falls cannot be told
        apart, and a region of all together leaves out what the less believed ones say.
        """
        area = self.area
        inside = np.zeros(len(area), bool)
        for probability in self.by_fall:
            order = np.argsort(-probability / area, kind="stable")
            before = np.cumsum(probability[order]) - probability[order]
            inside[order[before < share]] = True
        return inside

    def holds(self, east_m: float, north_m: float, share: float) -> bool:
        """Whether a place is in that region."""
        bearing = np.degrees(np.arctan2(east_m, north_m))
        beside = np.abs(wrap_degrees_180(self.bearing_deg - bearing))
        apart = np.abs(np.log(np.hypot(east_m, north_m) / self.range_m))
        here = (beside <= 0.5 * self.width_deg) & (apart <= 0.5 * np.log(self.ratio))
        return bool((here & self.region(share)).any())

    def outlines(self, share: float) -> list[list[tuple[float, float]]]:
        """Latitudes and longitudes around each part of a region, by rings."""
        inside = self.region(share)
        parts = []
        keys = np.stack((np.log(self.range_m), np.log(self.ratio), self.width_deg), axis=1)
        for key in np.unique(np.round(keys[inside], 6), axis=0):
            ring = inside & np.all(np.abs(keys - key) < 1e-5, axis=1)
            half = 0.5 * key[2]
            near, far = np.exp(key[0] - 0.5 * key[1]), np.exp(key[0] + 0.5 * key[1])
            for low, high in _runs(np.sort(self.bearing_deg[ring]), key[2]):
                around = np.arange(low - half, high + half + 1e-6, half)
                bearing = np.concatenate((around, around[::-1], around[:1]))
                distance = np.concatenate(
                    (np.full(len(around), far), np.full(len(around), near), [far])
                )
                latitude, longitude = self.plane.to_geodetic(*east_north(bearing, distance))
                parts.append(list(zip(latitude.tolist(), longitude.tolist(), strict=True)))
        return parts

    def parts(self, share: float = 0.95) -> "list[Part]":
        """Connected parts of a region, the likeliest first."""
        inside = np.flatnonzero(self.region(share))
        found = [self._part(cells) for cells in self._connected(inside)]
        return sorted(found, key=lambda one: -one.probability)

    def _connected(self, inside: NDArray[np.intp]) -> list[NDArray[np.intp]]:
        """Some cells by parts that hang together."""
        bearing, half = self.bearing_deg[inside], 0.5 * self.width_deg[inside]
        away, deep = np.log(self.range_m[inside]), 0.5 * np.log(self.ratio[inside])
        pairs = []
        for low in range(0, len(inside), _ROWS):  # all pairs at once would fill the memory
            some = np.s_[low : low + _ROWS, np.newaxis]
            beside = np.abs(wrap_degrees_180(bearing[some] - bearing))
            touching = beside <= 1.01 * (half[some] + half)
            touching &= np.abs(away[some] - away) <= 1.01 * (deep[some] + deep)
            row, column = np.nonzero(touching)
            pairs.append((row + low, column))
        row, column = (np.concatenate(one) for one in zip(*pairs, strict=True))
        graph = sparse.coo_array((np.ones(len(row), bool), (row, column)), (len(inside),) * 2)
        count, which = csgraph.connected_components(graph, directed=False)
        return [inside[which == number] for number in range(count)]

    def _part(self, cells: NDArray[np.intp]) -> "Part":
        east, north = self.likeliest_m(cells)
        (radius95,) = self.radii_m(east, north, (0.95,), cells)
        latitude, longitude = self.plane.to_geodetic(east, north)
        return Part(
            latitude_deg=float(latitude),
            longitude_deg=float(longitude),
            radius95_m=radius95,
            probability=float(self.probability[cells].sum()),
        )

    def likeliest_m(self, cells: NDArray[np.intp]) -> tuple[float, float]:
        """The likeliest place in some cells, from the middle of the flight.

        It is the mean where the probability is densest. That of all lies farther away than
        the tag: a distance is told the worse the greater it is, and more so beside a straight
        way, where each fall with distance has its own.
        """
        area = self.area[cells]
        density = self.probability[cells] / area
        weight = area * (density / density.max()) ** _SHARPER
        weight /= weight.sum()
        east, north = east_north(self.bearing_deg[cells], self.range_m[cells])
        return float(weight @ east), float(weight @ north)

    def middle_m(self) -> tuple[float, float]:
        """Where a tag is that is in one part of the ground; else the middle of all cells."""
        inside = np.flatnonzero(self.region(0.95))
        for part in self._connected(inside):
            if self.probability[part].sum() >= _ALONE:
                return self.likeliest_m(part)
        east, north = east_north(self.bearing_deg, self.range_m)
        return float(self.probability @ east), float(self.probability @ north)

    def radii_m(
        self,
        east_m: float,
        north_m: float,
        shares: Sequence[float],
        cells: NDArray[np.intp] | None = None,
    ) -> list[float]:
        """Radii of circles around a place that hold shares of the probability.

        Each cell's lies evenly over its ground, as in `region`: between its middles alone a
        single cell would have none.

        Parameters
        ----------
        east_m, north_m : float
            From the middle of the flight.
        shares : sequence of float
        cells : ndarray of intp, optional
            The share is of these; by default of all.
        """
        chosen = slice(None) if cells is None else cells
        parts = (np.arange(_WITHIN) + 0.5) / _WITHIN
        around, apart = (one.ravel() for one in np.meshgrid(parts - 0.5, parts))
        bearing = self.bearing_deg[chosen, np.newaxis]
        bearing = bearing + around * self.width_deg[chosen, np.newaxis]
        ratio = self.ratio[chosen, np.newaxis]
        # Evenly over the ground: squares of distances are even from the nearer border on.
        square = self.range_m[chosen, np.newaxis] ** 2 * ((1.0 - apart) / ratio + apart * ratio)
        east, north = east_north(bearing, np.sqrt(square))
        away = np.hypot(east - east_m, north - north_m).ravel()
        held = np.repeat(self.probability[chosen], len(around))
        order = np.argsort(away)
        sums = np.cumsum(held[order])
        last = np.searchsorted(sums, np.asarray(shares) * sums[-1])
        return [float(one) for one in away[order][np.minimum(last, len(order) - 1)]]

    def arc_deg(self, middle_deg: float, share: float) -> float:
        """Width of the arc around a bearing that holds a share of the probability."""
        fine = np.arange(0.0, 180.0, 0.1)
        away = np.abs(wrap_degrees_180(self.bearing_deg - middle_deg))
        # Each cell's probability lies evenly over its width.
        low = np.maximum(fine[:, np.newaxis] - (away - 0.5 * self.width_deg), 0.0)
        held = np.minimum(low / self.width_deg, 1.0) @ self.probability
        return 2.0 * float(fine[min(int(np.searchsorted(held, share)), len(fine) - 1)])


def _runs(bearings_deg: _Floats, step_deg: float) -> list[tuple[float, float]]:
    """First and last of bearings that follow each other."""
    cuts = np.flatnonzero(np.diff(bearings_deg) > 1.5 * step_deg) + 1
    return [(float(one[0]), float(one[-1])) for one in np.split(bearings_deg, cuts)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrainPulses:
    """The slots in which a train's pulses lie."""

    time_s: _Floats
    """(n,) from the first slot's beginning."""
    energy: _Floats
    """(n,) in units of the noise."""
    interval_s: float
    offset_hz: float
    pulses: int = 1
    """In a burst, of which each energy is the mean."""


def train_pulses(
    energies: SlotEnergies, train: FoldedTrain, gain: _Floats, gain_time_s: _Floats
) -> TrainPulses:
    """Refine a train between the cells of the search, and take its slots' energies.

    Parameters
    ----------
    energies : SlotEnergies
    train : FoldedTrain
    gain : ndarray of float64, shape (times,)
        Of its place.
    gain_time_s : ndarray of float64, shape (times,)
    """
    slot_s, slots = energies.slot_s, energies.energy.shape[1]
    span_s = slots * slot_s
    count = int((span_s - train.phase_s) / train.interval_s) + 1
    weight = np.interp(energies.time_s, gain_time_s, gain / (0.5 + gain))
    step_s = slot_s / max(count - 1, 1)
    row = int(np.argmin(np.abs(energies.offsets_hz - train.offset_hz)))
    rows = range(max(0, row - 1), min(len(energies.energy), row + 2))
    told = {near: told_energies(energies, near) for near in rows}
    best, kept = -np.inf, (row, train.phase_s, train.interval_s)
    for interval_s in train.interval_s + step_s * np.linspace(-1.5, 1.5, 13):
        for phase_s in train.phase_s + slot_s * np.linspace(-1.5, 1.5, 13):
            time_s = train_times_s(phase_s, interval_s, train.drift, span_s)
            at = np.floor(time_s / slot_s).astype(np.intp)
            at = at[(at >= 0) & (at < slots)]
            for near in rows:
                score = float(weight[at] @ told[near][at])
                if score > best:
                    best, kept = score, (near, float(phase_s), float(interval_s))
    row, phase_s, interval_s = kept
    time_s = train_times_s(phase_s, interval_s, train.drift, span_s)
    at = np.floor(time_s / slot_s).astype(np.intp)
    good = (at >= 0) & (at < slots)
    good[good] = (energies.heard | energies.loud[row])[at[good]]
    return TrainPulses(
        time_s=time_s[good],
        energy=energies.level[row, at[good]].astype(np.float64),
        interval_s=interval_s,
        offset_hz=float(energies.offsets_hz[row]),
        pulses=energies.pulses,
    )


def told_energies(energies: SlotEnergies, row: int) -> NDArray[np.float32]:
    """Energies of a frequency, with loud pulses as what is just not loud."""
    energy = energies.energy[row].copy()
    loud = energies.loud[row] & ~energies.heard
    energy[loud] = (np.log(energies.level[row, loud]) * _LOUD_AS - energies.mean[row]) / (
        energies.sigma[row]
    )
    return np.asarray(energy)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeardTrain:
    """A train in one flight, and the places that this flight looked at."""

    pulses: TrainPulses
    mean_noise_energy: float
    """Mean energy of a slot in noise, from which the number of exponentials follows."""
    places: Places
    log_trains: float | None = None
    """Logarithm of how many trains it is the likeliest of; None takes it as the tag's. Where it
    is weak the tag's may be another, and this flight then tells nothing."""
    rates: int = 1
    """That the tag has: with several, it may have been at another one in some slots."""

    @classmethod
    def among(
        cls,
        energies: SlotEnergies,
        pulses: TrainPulses,
        places: Places,
        *,
        rates: int,
        log_trains: float | None = None,
    ) -> "HeardTrain":
        """A train in the noise at its frequency."""
        row = int(np.argmin(np.abs(energies.offsets_hz - pulses.offset_hz)))
        quiet = energies.away_from(pulses.time_s)
        mean = energies.mean[row]
        if pulses.pulses == 1 and np.count_nonzero(quiet) >= _LEAST_QUIET:
            mean = energies.level[row, quiet].mean()
        return cls(
            pulses=pulses,
            mean_noise_energy=float(mean),
            places=places,
            log_trains=log_trains,
            rates=rates,
        )


def place_belief(heard: Sequence[HeardTrain]) -> PlaceBelief:
    """Weigh all places by a train's energies; likely cells are looked at in parts.

    Parameters
    ----------
    heard : sequence of HeardTrain
        Of one flight, or of several of a tag that rested, around one plane's middle.
    """
    levels_db = _levels_db(heard)
    tables = [_table(one) for one in heard]
    gains = common_gains([one.places for one in heard])
    here = heard[0].places
    from_here = (here.east_m, here.north_m)
    falls = _tells_falls(heard, from_here)
    logs = _all_logs(heard, gains, from_here, tables, levels_db, falls=falls)
    cells, level_db, probability = _fined(heard, logs, tables, levels_db)
    return _summary(probability, level_db, cells)


def train_evidence(one: HeardTrain) -> float:
    """Logarithm of how much likelier a train is with a tag, anywhere, than without one."""
    levels_db = _levels_db([one])
    places = one.places
    falls = _tells_falls([one], (places.east_m, places.north_m))
    gains = common_gains([places])
    logs = _all_logs(
        [replace(one, log_trains=None)],
        gains,
        (places.east_m, places.north_m),
        [_table(one)],
        levels_db,
        falls=falls,
        tempered=False,
    )
    held, _ = _over_levels(logs, levels_db)
    share = np.log(places.area / places.area.sum())
    return float(special.logsumexp(held + share))


def _levels_db(heard: Sequence[HeardTrain]) -> _Floats:
    """Levels of the strongest pulse that are looked at."""
    top_db = 10.0 * np.log10(
        max(1.0, *(float(np.quantile(one.pulses.energy, 0.98)) for one in heard))
    )
    return np.asarray(top_db + np.arange(_LEVELS_DB[0], _LEVELS_DB[1] + 0.5))


def told_share(one: HeardTrain, gain: _Floats, place: PlaceBelief) -> float:
    """Probability that a flight's train is the tag's, and not chance.

    Parameters
    ----------
    one : HeardTrain
    gain : ndarray of float64, shape (places, times)
        On the scale of all flights.
    place : PlaceBelief
        Of all flights, this one among them.
    """
    if one.log_trains is None:
        return 1.0
    likely = np.argsort(-place.probability, kind="stable")[:_LIKELY]
    held = place.probability[likely]
    table = _table(one)
    levels_db = place.level_db + _BETWEEN_DB * np.linspace(-2.0, 2.0, 13)
    logs = _logs(one, _gain_db(one, gain[likely]), table, levels_db, tempered=False)
    weight = np.exp(-0.5 * np.linspace(-2.0, 2.0, 13) ** 2)
    own = special.logsumexp(logs, axis=1, b=weight / weight.sum())
    return float(held @ special.expit(own - one.log_trains) / held.sum())


def _tells_falls(heard: Sequence[HeardTrain], east_north_m: tuple[_Floats, _Floats]) -> bool:
    """Whether any of some places was at different distances: what is far away was not."""
    away_db = [_away_db(one, *east_north_m) for one in heard]
    spread_db = np.ptp(np.concatenate(away_db, axis=1), axis=1)
    return bool(spread_db.max() >= _SAME_RANGE_DB)


def _all_logs(
    heard: Sequence[HeardTrain],
    gains: Sequence[_Floats],
    east_north_m: tuple[_Floats, _Floats],
    tables: Sequence[_Floats],
    levels_db: _Floats,
    *,
    falls: bool,
    tempered: bool = True,
) -> _Floats:
    """Log likelihood ratio and belief of each fall, place and level, over all flights.

    Without `falls` there is one, as none can be told from another. Tempered it allows for what
    pulses have in common beyond the model, as places are told apart by it.
    """
    gains_db = [_gain_db(one, gain) for one, gain in zip(heard, gains, strict=True)]
    if not falls:
        return _joint_logs(heard, gains_db, tables, levels_db, tempered)[np.newaxis]
    away_db = [_away_db(one, *east_north_m) for one in heard]
    top_db = _strongest(gains_db)
    logs = []
    for exponent in _EXPONENTS:
        turned_db = [
            gain_db + (EXPONENT - exponent) * away
            for gain_db, away in zip(gains_db, away_db, strict=True)
        ]
        shift_db = top_db - _strongest(turned_db)  # levels are of the strongest pulse
        turned_db = [one + shift_db for one in turned_db]
        logs.append(_joint_logs(heard, turned_db, tables, levels_db, tempered))
    return np.asarray(np.stack(logs) + np.log(_EXPONENT_SHARES)[:, np.newaxis, np.newaxis])


def _over_levels(logs: _Floats, levels_db: _Floats) -> tuple[_Floats, _Floats]:
    """Logarithm of the mean of likelihoods over levels, and the mean level of each [dB].

    That of a loud tag is told to a fraction of the step between levels: between them the
    logarithm follows a spline, for it is smooth.

    Parameters
    ----------
    logs : ndarray of float64, shape (falls, places, levels)
    levels_db : ndarray of float64, shape (levels,)
    """
    fine = np.linspace(levels_db[0], levels_db[-1], _LEVEL_PARTS * (len(levels_db) - 1) + 1)
    between = interpolate.CubicSpline(levels_db, logs, axis=2)(fine)
    top = between.max(axis=2)
    between -= top[..., np.newaxis]
    likelihood = np.exp(between, out=between)
    total = likelihood.sum(axis=2)
    return top + np.log(total / len(fine)), likelihood @ fine / total


def _strongest(gains_db: Sequence[_Floats]) -> _Floats:
    """Of each place over all flights: (places, 1)."""
    return np.asarray(np.max([one.max(axis=1) for one in gains_db], axis=0))[:, np.newaxis]


def _joint_logs(
    heard: Sequence[HeardTrain],
    gains_db: Sequence[_Floats],
    tables: Sequence[_Floats],
    levels_db: _Floats,
    tempered: bool,
) -> _Floats:
    """Log likelihood ratio of each place and level, over all flights."""
    logs = np.zeros((len(gains_db[0]), len(levels_db)))
    for one, gain_db, table in zip(heard, gains_db, tables, strict=True):
        chance = one.log_trains is not None
        own = _logs(one, gain_db, table, levels_db, tempered=tempered and not chance)
        if one.log_trains is not None:
            # Whether it is the tag's train all of its evidence tells; where it is, less.
            own = _COUNTED * np.logaddexp(0.0, own - one.log_trains)
        if len(heard) > 1:
            top = own.max(axis=1, keepdims=True)
            blurred = ndimage.gaussian_filter1d(np.exp(own - top), _BETWEEN_DB, mode="nearest")
            own = top + np.log(np.maximum(blurred, 1e-300))
        logs += own
    return logs


def _gain_db(one: HeardTrain, gain: _Floats) -> _Floats:
    """Gains at the pulses: (places, pulses)."""
    at_s, time_s = one.pulses.time_s, one.places.time_s
    return 10.0 * np.log10(np.stack([np.interp(at_s, time_s, row) for row in gain]) + 1e-9)


def _away_db(one: HeardTrain, east_m: _Floats, north_m: _Floats) -> _Floats:
    """How far places were at the pulses: (places, pulses)."""
    time_s = one.places.time_s
    part = np.interp(one.pulses.time_s, time_s, np.arange(len(time_s)).astype(np.float64))
    return one.places.track.away_db(east_m, north_m, part)


def _logs(
    one: HeardTrain, gain_db: _Floats, table: _Floats, levels_db: _Floats, *, tempered: bool
) -> _Floats:
    """Log likelihood ratio of each place and level, levels a whole number of steps apart.

    Of a tag with several rates the pulses' are not just added up: it may have been at another
    one, and what is silent then says nothing of where it is.
    """
    amplitude = np.sqrt(np.maximum(one.pulses.energy, 0.0))
    column = np.minimum(np.rint(amplitude / _AMPLITUDES[1]), len(_AMPLITUDES) - 1)
    chosen = table[:, column.astype(np.intp)].T.astype(np.float32)
    if tempered:
        chosen *= _counted(one.pulses)[:, np.newaxis]
    # Levels lie so many of the table's steps apart: those of a place and pulse follow each
    # other among every so many of its rows.
    apart = round((levels_db[1] - levels_db[0]) / _STEP_DB)
    beyond = apart * len(levels_db)
    padded = np.pad(chosen, ((0, 0), (beyond, beyond + apart)), mode="edge")
    width = padded.shape[1] // apart
    padded = padded[:, : width * apart].reshape(len(padded), width, apart)
    thinned = np.ascontiguousarray(np.moveaxis(padded, 2, 0))
    levels = np.lib.stride_tricks.sliding_window_view(thinned, len(levels_db), axis=2)
    at = np.arange(len(column))
    logs = np.empty((len(gain_db), len(levels_db)))
    if one.rates > 1:
        inverses = np.exp(-thinned.astype(np.float64))
        inverses = np.lib.stride_tricks.sliding_window_view(inverses, len(levels_db), axis=2)
    # Few places at a time: what is looked up stays in the processor's cache.
    block = max(1, _BLOCK // max(len(at), 1)) if one.rates == 1 else _BLOCK_OF_RATES
    for low in range(0, len(gain_db), block):
        some = slice(low, low + block)
        first = np.rint((gain_db[some] + levels_db[0] - _STRENGTHS_DB[0]) / _STEP_DB)
        first = np.clip(first, -beyond, chosen.shape[1] - 1).astype(np.intp) + beyond
        logs[some] = levels[first % apart, at, first // apart].sum(axis=1)
        if one.rates > 1:
            each = (inverses[row % apart, n, row // apart] for n, row in enumerate(first.T))
            logs[some] += other_rate_logs(each, logs[some].shape)
    return logs


def _counted(pulses: TrainPulses) -> NDArray[np.float32]:
    """Share of each slot's evidence that counts, (n,): less of a loud pulse's.

    A level of energy E over noise has a variance of 37.7/E dB² by noise (of noncentral
    chi-square), and that of single pulses' fading.
    """
    variance_db2 = 37.7 / np.maximum(pulses.energy, 1.0) + _FADING_DB**2
    beyond = np.maximum(1.0 / variance_db2 - 1.0 / _NOISY_DB2, 0.0)
    return (1.0 / (1.0 / _COUNTED + _LASTING_DB2 * beyond)).astype(np.float32)


def _fined(
    heard: Sequence[HeardTrain], logs: _Floats, tables: Sequence[_Floats], levels_db: _Floats
) -> tuple[Cells, float, _Floats]:
    """Cells, the likely ones in parts; the mean level [dB]; how likely each place is."""
    places = heard[0].places
    count = len(places.east_m)
    held, level_db = _over_levels(logs, levels_db)
    each = (np.exp(held - held.max()) * places.area).sum(axis=0)
    ground = _Ground(
        bearing_deg=places.bearing_deg,
        range_m=np.hypot(places.east_m, places.north_m),
        width_deg=np.full(count, BEARING_STEP_DEG),
        ratio=np.full(count, RANGE_STEP),
        uneven=np.full(count, np.inf),
        logs=held,
        level_db=level_db,
    )
    for _ in range(_MOST_ROUNDS):
        which = ground.to_part()
        if not len(which):
            break
        parts = ground.parts(which)
        found = _logs_anywhere(heard, parts, tables, levels_db, falls=len(logs) > 1)
        held, level_db = _over_levels(found, levels_db)
        ground = ground.with_parts(which, replace(parts, logs=held, level_db=level_db))
    held = ground.held
    told = held[held.sum(axis=1) >= _LEAST_FALL]
    cells = Cells(
        plane=places.plane,
        bearing_deg=ground.bearing_deg,
        range_m=ground.range_m,
        width_deg=ground.width_deg,
        ratio=ground.ratio,
        probability=held.sum(axis=0),
        by_fall=told / told.sum(axis=1, keepdims=True),
    )
    return cells, float((held * ground.level_db).sum()), each / each.sum()


def _area(range_m: _Floats, width_deg: _Floats, ratio: _Floats) -> _Floats:
    """Ground of cells, relative: their depth is by a ratio of distances."""
    return np.asarray(range_m**2 * width_deg * np.sinh(np.log(ratio)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Ground:
    """Cells of the ground, and the likelihoods at their middles."""

    bearing_deg: _Floats
    """(cells,) as of `Cells`."""
    range_m: _Floats
    width_deg: _Floats
    ratio: _Floats
    uneven: _Floats
    """By how much log likelihoods differ among the parts of which a cell is one."""
    logs: _Floats
    """(falls, cells) over all levels."""
    level_db: _Floats
    """(falls, cells) mean level."""

    @property
    def area(self) -> _Floats:
        """(cells,) ground, relative."""
        return _area(self.range_m, self.width_deg, self.ratio)

    @property
    def held(self) -> _Floats:
        """Probabilities, in that shape."""
        held = np.exp(self.logs - self.logs.max()) * self.area
        return np.asarray(held / held.sum())

    def to_part(self) -> NDArray[np.intp]:
        """Which cells are looked at in parts: those that hold nearly all, and the likeliest.

        Of these the ones in which the likelihood varies, and that are wide enough.
        """
        probability = self.held.sum(axis=0)
        order = np.argsort(-probability, kind="stable")
        count = int(np.searchsorted(np.cumsum(probability[order]), _KEPT)) + 1
        likeliest = np.argsort(-self.logs.max(axis=0), kind="stable")[:_ALWAYS_FINED]
        which = np.union1d(order[: min(count, _MOST_FINED)], likeliest)
        size_m = self.range_m * np.maximum(np.radians(self.width_deg), np.log(self.ratio))
        return np.asarray(which[(size_m[which] > _FINEST_M) & (self.uneven[which] > _EVEN)])

    def parts(self, which: NDArray[np.intp]) -> "_Ground":
        """Some cells in parts, which hold nothing yet."""
        steps = (np.arange(_FINE) - 0.5 * (_FINE - 1)) / _FINE
        around, apart = (one.ravel() for one in np.meshgrid(steps, steps))
        width, ratio = self.width_deg[which, np.newaxis], self.ratio[which, np.newaxis]
        bearing = self.bearing_deg[which, np.newaxis] + around * width
        distance = self.range_m[which, np.newaxis] * ratio**apart
        return _Ground(
            bearing_deg=wrap_degrees_360(bearing.ravel()),
            range_m=distance.ravel(),
            width_deg=np.repeat(width / _FINE, len(around)),
            ratio=np.repeat(ratio ** (1.0 / _FINE), len(around)),
            uneven=np.zeros(distance.size),
            logs=np.zeros((len(self.logs), distance.size)),
            level_db=np.zeros((len(self.logs), distance.size)),
        )

    def with_parts(self, which: NDArray[np.intp], parts: "_Ground") -> "_Ground":
        """Parts in place of their cells."""
        rest = np.setdiff1d(np.arange(len(self.range_m)), which)
        best = parts.logs.max(axis=0).reshape(len(which), _FINE * _FINE)
        uneven = np.repeat(np.ptp(best, axis=1), _FINE * _FINE)
        return _Ground(
            bearing_deg=np.concatenate((parts.bearing_deg, self.bearing_deg[rest])),
            range_m=np.concatenate((parts.range_m, self.range_m[rest])),
            width_deg=np.concatenate((parts.width_deg, self.width_deg[rest])),
            ratio=np.concatenate((parts.ratio, self.ratio[rest])),
            uneven=np.concatenate((uneven, self.uneven[rest])),
            logs=np.concatenate((parts.logs, self.logs[:, rest]), axis=1),
            level_db=np.concatenate((parts.level_db, self.level_db[:, rest]), axis=1),
        )


def _logs_anywhere(
    heard: Sequence[HeardTrain],
    ground: _Ground,
    tables: Sequence[_Floats],
    levels_db: _Floats,
    *,
    falls: bool,
) -> _Floats:
    """As `_all_logs` of cells that are not among the flight's places."""
    from_here = east_north(ground.bearing_deg, ground.range_m)
    each_db = [one.places.track.gain_db(*from_here) for one in heard]
    strongest_db = np.stack([gain_db.max(axis=1) for gain_db in each_db])
    gains = [
        10.0 ** ((gain_db - strongest_db.max(axis=0)[:, np.newaxis]) / 10.0)
        for gain_db in each_db
    ]
    return _all_logs(heard, gains, from_here, tables, levels_db, falls=falls)


def _summary(probability: _Floats, level_db: float, cells: Cells) -> PlaceBelief:
    held = cells.probability
    east, north = cells.middle_m()
    radius50, radius95 = cells.radii_m(east, north, (0.5, 0.95))
    latitude, longitude = cells.plane.to_geodetic(east, north)
    turn = np.radians(cells.bearing_deg)
    mean = float(np.degrees(np.arctan2(held @ np.sin(turn), held @ np.cos(turn))))
    return PlaceBelief(
        latitude_deg=float(latitude),
        longitude_deg=float(longitude),
        radius50_m=radius50,
        radius95_m=radius95,
        bearing_deg=wrap_degrees_360(mean),
        arc50_deg=cells.arc_deg(mean, 0.5),
        arc95_deg=cells.arc_deg(mean, 0.95),
        level_db=level_db,
        probability=probability,
        cells=cells,
    )


def slot_logs(one: HeardTrain, gain: _Floats, levels_db: _Floats) -> _Floats:
    """Log likelihood ratio of a pulse in each slot, shape (levels, slots).

    Parameters
    ----------
    one : HeardTrain
    gain : ndarray of float64, shape (slots,)
        Energy of a pulse relative to the strongest.
    levels_db : ndarray of float64, shape (levels,)
        Energy over noise of the strongest.
    """
    table = _table(one)
    amplitude = np.sqrt(np.maximum(one.pulses.energy, 0.0)) / _AMPLITUDES[1]
    column = np.minimum(np.rint(amplitude), len(_AMPLITUDES) - 1).astype(np.intp)
    gain_db = 10.0 * np.log10(gain + 1e-9)
    strength = np.rint((gain_db + levels_db[:, np.newaxis] - _STRENGTHS_DB[0]) / _STEP_DB)
    strength = np.clip(strength, 0, len(table) - 1).astype(np.intp)
    return np.asarray(table[strength, column])


def noise_reaches(one: HeardTrain, share: float) -> float:
    """Energy of a slot that noise alone exceeds in a share of the slots."""
    pulses, mean = one.pulses.pulses, one.mean_noise_energy
    many = _exponentials(mean) if pulses == 1 else exponentials(mean, pulses)
    return float(special.gammaincinv(pulses, (1.0 - share) ** (1.0 / many)) / pulses)


def _table(one: HeardTrain) -> _Floats:
    """Log likelihood ratios of the energies of a train's pulses, or bursts.

    Shape (strengths `_STEP_DB` apart, amplitudes).
    """
    pulses, mean = one.pulses.pulses, one.mean_noise_energy
    many = _exponentials(mean) if pulses == 1 else exponentials(mean, pulses)
    finer = np.arange(_STRENGTHS_DB[0], _STRENGTHS_DB[-1] + 0.5 * _STEP_DB, _STEP_DB)
    return np.asarray(interpolate.CubicSpline(_STRENGTHS_DB, _log_ratios(many, pulses))(finer))


def _exponentials(mean: float) -> float:
    """How many unit exponentials have a largest of such a mean: H(m) = mean."""
    many = np.linspace(1.0, 12.0, 1101)
    means = special.digamma(many + 1.0) + np.euler_gamma
    return float(many[int(np.argmin(np.abs(means - mean)))])


def _log_ratios(many: float, pulses: int = 1) -> _Floats:
    """Log likelihood ratio of a slot's energy, shape (strengths, amplitudes).

    Of bursts the mean of their pulses stands in place of E, and of the largest of m one may be
    a burst's: f/(m e^-E) + (m-1)/m F/(1-e^-E) of one pulse. What fades or hides a burst does so
    to all of its pulses.
    """
    energy = np.maximum(_AMPLITUDES, 0.1) ** 2
    if pulses == 1:
        ratio = _pulse_ratio(energy, many)
    else:
        strength = 10.0 ** (_STRENGTHS_DB / 10.0)[:, np.newaxis]
        density, law = log_ratio_parts(energy, strength, pulses)
        ratio = density / many + (many - 1.0) / many * law
    step = _STRENGTHS_DB[1] - _STRENGTHS_DB[0]
    ratio = ndimage.gaussian_filter1d(ratio, _FADING_DB / step, axis=0, mode="nearest")
    ratio = (1.0 - _OUTLIER) * ratio + _OUTLIER
    return np.asarray(np.maximum(np.log(ratio), _LEAST_LOG))


def _pulse_ratio(energy: _Floats, many: float) -> _Floats:
    """Likelihood ratio of the largest of m exponentials, two of which may be a pulse's.

    With f and F the densities, over that of noise, and laws of their energies, N = 1 - e^-E
    and q = 1, it is (f1 F2^q + q f2 F1 F2^(q-1))/(m N^q) + (m-1-q)/m F1 F2^q/N^(1+q); q falls
    to 0 with m to 1.
    """
    below = -np.expm1(-energy)
    (first, first_law), (second, second_law) = (_pulse_law(energy, part) for part in _WINDOWS)
    both = min(1.0, many - 1.0)
    law = np.maximum(second_law, 1e-300) ** both
    ratio = first * law + both * second * first_law * law / np.maximum(second_law, 1e-300)
    ratio /= many * below**both
    return np.asarray(
        ratio + (many - 1.0 - both) / many * first_law * law / below ** (1.0 + both)
    )


def _pulse_law(energy: _Floats, part: float) -> tuple[_Floats, _Floats]:
    """Density over that of noise, and law, of a window with a part of a pulse's energy."""
    strength = part * 10.0 ** (_STRENGTHS_DB / 10.0)[:, np.newaxis]
    x = 2.0 * np.sqrt(energy * strength)
    # Bounded: what is so far above noise is beyond doubt.
    density = np.exp(np.minimum(x - strength + np.log(special.i0e(x)), 600.0))
    return density, np.asarray(stats.ncx2.cdf(2.0 * energy, 2, 2.0 * strength))
