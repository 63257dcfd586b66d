"""Estimate the position of the tag that sent a folded train, from pulse energies and antenna
gains.

The level is a nuisance parameter with a flat prior in decibels; the position's prior is uniform
over the ground.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, ndimage, special

from uavrt.core.units import wrap_degrees_360
from uavrt.localization.antenna import MONOPOLE
from uavrt.localization.number_kinds import Fixed
from uavrt.localization.position.tuning import COMMON, WALK
from uavrt.localization.position.walks import Peak, Velocity, Walk, walk_of
from uavrt.localization.tuning import LEVELS
from uavrt.localization.whole_flight.ground_cells import Cells, LikelyGround
from uavrt.localization.whole_flight.heard_train import (
    STRENGTHS_DB,
    HeardTrain,
    likelihood_table,
    table_columns,
)
from uavrt.localization.whole_flight.rate_of_flight import other_rate_logs
from uavrt.localization.whole_flight.tag_places import (
    BEARING_STEP_DEG,
    RANGE_STEP,
    east_north,
)
from uavrt.localization.whole_flight.tuning import ENERGY, PLACE

_Floats = NDArray[np.float64]
_EXPONENT_SHARES = np.diff(
    special.ndtr(
        (np.array([-np.inf, 2.25, 2.75, 3.25, 3.75, np.inf]) - LEVELS.exponent)
        / LEVELS.exponent_sigma
    )
)
"""Prior probability of each path loss exponent, from `level_evidence.Propagation`. The quarter
below free space is added to free space, for tags in line of sight."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceBelief:
    """Posterior of a tag's position, after a whole flight."""

    latitude_deg: float
    longitude_deg: float
    radius50_m: float
    radius95_m: float
    bearing_deg: float
    """Bearing of the tag from the middle of the flight [deg]."""
    arc50_deg: float
    """Width of the arc that contains the tag's bearing with 50 % probability [deg]."""
    arc95_deg: float
    level_db: float
    """Energy over noise of the tag's strongest pulse [dB]."""
    fading_db: float
    """Standard deviation of the difference between single pulses' levels and the model [dB]."""
    probability: _Floats
    """Posterior probability of each candidate position of the tag, shape (places,)."""
    cells: Cells
    walk: Walk | None = None
    """Test whether the tag walked; None: not made, since its position is too uncertain."""

    @property
    def walked(self) -> bool:
        """True if the tag seems to have walked; its position is then that at the last pulse."""
        return self.walk is not None and self.walk.walked

    def arc_deg(self, share: float) -> float:
        """Width of the arc around the bearing that contains a given probability [deg]."""
        return self.cells.arc_deg(self.bearing_deg, share)


def place_belief(heard: Sequence[HeardTrain]) -> PlaceBelief:
    """Estimate the posterior of the position of the tag that sent a train.

    Likely cells of the ground are divided. In a single flight, it is tested whether the tag
    rested; if it seems to have walked, the position is that at the last pulse.
    """
    reading = _Reading.of(heard)
    found = _placed(reading)
    loudest = max(float(np.quantile(one.pulses.energy, 0.98)) for one in heard)
    if loudest >= ENERGY.loud_power:
        readings = [
            reading,
            *(_Reading.of(heard, fading_db) for fading_db in PLACE.fadings_db[1:]),
        ]
        tried = {reading.fading_db}
        while (reading := _likeliest(readings, found.cells)).fading_db not in tried:
            tried.add(reading.fading_db)
            found = _placed(reading)
    return found if len(heard) > 1 else _if_at_rest(reading, found)


def _if_at_rest(reading: "_Reading", found: PlaceBelief) -> PlaceBelief:
    """Position at rest with the test of a walk, or the walker's position at the last pulse."""
    one, pulses = reading.heard[0], reading.heard[0].pulses
    span_s = float(np.ptp(pulses.time_s))
    if len(pulses.time_s) < WALK.least_pulses or span_s < WALK.least_span_s:
        return found
    if found.radius95_m > WALK.most_radius_m:
        return found
    strength = np.maximum(pulses.energy - one.mean_noise_energy, 0.0)
    place_s = float(pulses.time_s @ strength / strength.sum())

    def likelihood(velocity: Velocity, east_m: _Floats, north_m: _Floats) -> _Floats:
        walker = replace(reading, heard=[one.of_walker(velocity, place_s)])
        logs = _all_logs(walker, (east_m, north_m), falls=True, tempered=False)
        held, _ = _over_levels(logs, reading.levels_db)
        return np.asarray(special.logsumexp(held, axis=0))

    east, north = found.cells.densest_m()
    rest = Peak(score=0.0, velocity=(0.0, 0.0), place=(east, north), log_evidence=0.0)
    step_m_s = 2.0 * WALK.rough_step_m_s
    steps = max(found.radius95_m, 0.5 * step_m_s * span_s), step_m_s
    walk, _ = walk_of(likelihood, rest, rest, place_s, steps, WALK.flight)
    found = replace(found, walk=walk)
    if not found.walked:
        return found
    last_s = float(pulses.time_s.max())
    walkers = tuple(one.of_walker(velocity, last_s) for velocity in walk.velocities)
    return replace(_placed(replace(reading, walkers=walkers)), walk=walk)


def _placed(reading: "_Reading") -> PlaceBelief:
    heard = reading.heard
    here = heard[0].places
    from_here = (here.east_m, here.north_m)
    logs = _all_logs(reading, from_here, falls=_shows_falls(heard, from_here))
    cells, level_db, probability = _refined_cells(reading, logs)
    return _summary(probability, level_db, reading.fading_db, cells)


def _likeliest(readings: Sequence["_Reading"], cells: Cells) -> "_Reading":
    """Choose the most likely of the assumed fading sizes; the usual one unless the evidence is
    clear.
    """
    heard = readings[0].heard
    which = np.argsort(-cells.probability, kind="stable")[: PLACE.fading_cells]
    from_here = east_north(cells.bearing_deg[which], cells.range_m[which])
    # An unusual path loss exponent must not be taken for fading.
    falls = _shows_falls(heard, (heard[0].places.east_m, heard[0].places.north_m))
    evidence = []
    for reading in readings:
        logs = _turned_logs(reading, from_here, 0.0, falls, tempered=False)
        held, _ = _over_levels(logs, reading.levels_db)
        evidence.append(float(special.logsumexp(held, b=cells.area[which])))
    best = int(np.argmax(evidence))
    return readings[best if evidence[best] - evidence[0] > PLACE.more_fading_log else 0]


def train_evidence(one: HeardTrain) -> float:
    """Log likelihood ratio of a train: a tag at any position against no tag."""
    reading = _Reading.of([replace(one, log_trains=None)])
    places = one.places
    from_here = (places.east_m, places.north_m)
    falls = _shows_falls([one], from_here)
    logs = _turned_logs(reading, from_here, 0.0, falls, tempered=False)
    held, _ = _over_levels(logs, reading.levels_db)
    share = np.log(places.area / places.area.sum())
    return float(special.logsumexp(held + share))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Reading:
    """Energies of a tag's flights, with the fading that is assumed for single pulses."""

    heard: Sequence[HeardTrain]
    fading_db: float
    tables: tuple[_Floats, ...]
    levels_db: _Floats
    walkers: tuple[HeardTrain, ...] = ()
    """The train with each velocity of a tag that walks; empty: the tag rests."""

    @classmethod
    def of(
        cls, heard: Sequence[HeardTrain], fading_db: float = PLACE.fadings_db[0]
    ) -> "_Reading":
        return cls(
            heard=heard,
            fading_db=fading_db,
            tables=tuple(likelihood_table(one, fading_db) for one in heard),
            levels_db=_levels_db(heard),
        )


def _levels_db(heard: Sequence[HeardTrain]) -> _Floats:
    top_db = 10.0 * np.log10(
        max(1.0, *(float(np.quantile(one.pulses.energy, 0.98)) for one in heard))
    )
    return np.asarray(top_db + np.arange(PLACE.levels_db[0], PLACE.levels_db[1] + 0.5))


def tag_share(one: HeardTrain, gain: _Floats, place: PlaceBelief) -> float:
    """Probability that a flight's train is the tag's and not a result of chance."""
    if one.log_trains is None:
        return 1.0
    likely = np.argsort(-place.probability, kind="stable")[: PLACE.likely_places]
    held = place.probability[likely]
    table = likelihood_table(one, place.fading_db)
    levels_db = place.level_db + LEVELS.shadowing_db * np.linspace(-2.0, 2.0, 13)
    gain_db = _at_pulses_db(one, 10.0 * np.log10(gain[likely] + 1e-9)) - one.pulses.noise_db
    logs = _logs(one, gain_db, table, levels_db)
    weight = np.exp(-0.5 * np.linspace(-2.0, 2.0, 13) ** 2)
    own = special.logsumexp(logs, axis=1, b=weight / weight.sum())
    return float(held @ special.expit(own - one.log_trains) / held.sum())


def _shows_falls(heard: Sequence[HeardTrain], east_north_m: tuple[_Floats, _Floats]) -> bool:
    """True if the distance to a position varied enough to estimate the path loss exponent."""
    away_db = [_away_db(one, *east_north_m) for one in heard]
    spread_db = np.ptp(np.concatenate(away_db, axis=1), axis=1)
    return bool(spread_db.max() >= PLACE.same_range_db)


def _all_logs(
    reading: _Reading,
    east_north_m: tuple[_Floats, _Floats],
    *,
    falls: bool,
    tempered: bool = True,
) -> _Floats:
    """Log likelihood ratio of all flights plus log-prior of the exponents, shape (exponents,
    places, levels).

    The error common to all headings is integrated out, by a parabola through no error and the
    largest ones to both sides. Velocities of a tag that walks are averaged. `falls` is True to
    examine all path loss exponents.
    """
    if reading.walkers:
        each = [
            _all_logs(replace(reading, heard=[one], walkers=()), east_north_m, falls=falls)
            for one in reading.walkers
        ]
        return np.asarray(np.logaddexp.reduce(each) - np.log(len(each)))
    if all(one.places.track.pattern.name == MONOPOLE for one in reading.heard):
        return _turned_logs(reading, east_north_m, 0.0, falls, tempered)
    # Inside the examined errors, the parabola is an interpolation: at a wrong position the
    # likelihood changes so fast that its extension would exceed that of the true one.
    most = PLACE.most_heading_sigmas
    low, middle, high = (
        _turned_logs(reading, east_north_m, turn * COMMON.heading_sigma_deg, falls, tempered)
        for turn in (-most, 0.0, most)
    )
    slope = (high - low) / (2.0 * most)
    bend = 1.0 + np.maximum(2.0 * middle - low - high, 0.0) / most**2
    vertex = np.clip(slope / bend, -most, most)
    return np.asarray(middle + (slope - 0.5 * bend * vertex) * vertex - 0.5 * np.log(bend))


def _turned_logs(
    reading: _Reading,
    east_north_m: tuple[_Floats, _Floats],
    turn_deg: float,
    falls: bool,
    tempered: bool = True,
) -> _Floats:
    """Return the result of `_all_logs` for one heading error; with `tempered`, the evidence is
    reduced by `_counted`.
    """
    heard = reading.heard
    each_db = [one.places.track.gain_db(*east_north_m, turn_deg) for one in heard]
    strongest_db = np.max([one.max(axis=1) for one in each_db], axis=0)[:, np.newaxis]
    gains_db = [
        _at_pulses_db(one, own - strongest_db) for one, own in zip(heard, each_db, strict=True)
    ]
    top_db = _strongest(gains_db)
    away_db = [_away_db(one, *east_north_m) for one in heard]
    logs = []
    for exponent in PLACE.exponents if falls else (LEVELS.exponent,):
        over_db = [
            gain_db + (LEVELS.exponent - exponent) * away - one.pulses.noise_db
            for one, gain_db, away in zip(heard, gains_db, away_db, strict=True)
        ]
        shift_db = top_db - _strongest(over_db)  # levels are of the strongest pulse
        logs.append(_joint_logs(reading, [one + shift_db for one in over_db], tempered))
    shares = _EXPONENT_SHARES if falls else np.ones(1)
    return np.asarray(np.stack(logs) + np.log(shares)[:, np.newaxis, np.newaxis])


def _over_levels(logs: _Floats, levels_db: _Floats) -> tuple[_Floats, _Floats]:
    """Log-likelihood averaged over tag levels, and mean tag level [dB], shape (exponents,
    places) each.
    """
    fine = np.linspace(
        levels_db[0], levels_db[-1], PLACE.level_parts * (len(levels_db) - 1) + 1
    )
    between = interpolate.CubicSpline(levels_db, logs, axis=2)(fine)
    top = between.max(axis=2)
    between -= top[..., np.newaxis]
    likelihood = np.exp(between, out=between)
    total = likelihood.sum(axis=2)
    return top + np.log(total / len(fine)), likelihood @ fine / total


def _strongest(gains_db: Sequence[_Floats]) -> _Floats:
    return np.asarray(np.max([one.max(axis=1) for one in gains_db], axis=0))[:, np.newaxis]


def _joint_logs(reading: _Reading, gains_db: Sequence[_Floats], tempered: bool) -> _Floats:
    heard, levels_db = reading.heard, reading.levels_db
    logs = np.zeros((len(gains_db[0]), len(levels_db)))
    for one, gain_db, table in zip(heard, gains_db, reading.tables, strict=True):
        counted = 1.0
        if tempered and one.log_trains is None:
            counted = _counted(one, reading.fading_db)
        own = _logs(one, gain_db, table, levels_db, counted)
        if one.log_trains is not None:
            # All evidence counts for whether the train is the tag's, less for the position.
            own = PLACE.counted * np.logaddexp(0.0, own - one.log_trains)
        if len(heard) > 1:
            top = own.max(axis=1, keepdims=True)
            blurred = ndimage.gaussian_filter1d(
                np.exp(own - top), LEVELS.shadowing_db, mode="nearest"
            )
            own = top + np.log(np.maximum(blurred, 1e-300))
        logs += own
    return logs


def _at_pulses_db(one: HeardTrain, gain_db: _Floats) -> _Floats:
    """Antenna gain at each pulse [dB], interpolated from the gain at all times, shape (places,
    pulses).
    """
    at_s, time_s = one.pulses.time_s, one.places.time_s
    return np.stack([np.interp(at_s, time_s, row) for row in gain_db])


def _away_db(one: HeardTrain, east_m: _Floats, north_m: _Floats) -> _Floats:
    time_s = one.places.time_s
    part = np.interp(one.pulses.time_s, time_s, np.arange(len(time_s)).astype(np.float64))
    return one.places.track.away_db(east_m, north_m, part)


def _logs(
    one: HeardTrain,
    gain_db: _Floats,
    table: _Floats,
    levels_db: _Floats,
    counted: Fixed[float] = 1.0,
) -> _Floats:
    """Log likelihood ratio of a flight, shape (places, levels); the levels are whole table
    steps apart.
    """
    column, beyond_db = table_columns(one.pulses.energy)
    chosen = table[:, column].T.astype(np.float32)
    chosen *= np.float32(counted)
    # Levels are `apart` of the table's steps from each other: those of a place and pulse
    # are among every `apart`-th of its rows.
    apart = round((levels_db[1] - levels_db[0]) / PLACE.strength_step_db)
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
    # Few positions at a time, so that look-ups stay in the processor's cache.
    block = max(1, PLACE.block // max(len(at), 1)) if one.rates == 1 else PLACE.rates_block
    for low in range(0, len(gain_db), block):
        some = slice(low, low + block)
        sought_db = gain_db[some] - beyond_db + levels_db[0]
        first = np.rint((sought_db - STRENGTHS_DB[0]) / PLACE.strength_step_db)
        first = np.clip(first, -beyond, chosen.shape[1] - 1).astype(np.intp) + beyond
        logs[some] = levels[first % apart, at, first // apart].sum(axis=1)
        if one.rates > 1:
            each = (inverses[row % apart, n, row // apart] for n, row in enumerate(first.T))
            logs[some] += other_rate_logs(each, logs[some].shape)
    return logs


def _counted(one: HeardTrain, fading_db: float) -> float:
    """Share of a flight's evidence that is used; the share is smaller for strong pulses.

    A level with energy E over noise has the variance 37.7/E dB² by noise (noncentral
    chi-square), plus the variance of single pulses' fading. The inverse of their sum is the
    pulse's information. All pulses get the same share, because otherwise errors common to many
    weak pulses would shift the position.
    """
    above = np.maximum(one.pulses.energy - one.mean_noise_energy, 0.01)
    precision = 1.0 / (37.7 / above + fading_db**2)
    beyond = float(precision @ np.maximum(precision - 1.0 / PLACE.noisy_db2, 0.0)) / float(
        precision.sum()
    )
    return 1.0 / (1.0 / PLACE.counted + PLACE.lasting_db2 * beyond)


def _refined_cells(reading: _Reading, logs: _Floats) -> tuple[Cells, float, _Floats]:
    """Return ground cells of which likely ones are divided, the mean tag level [dB], and the
    probability of positions.
    """
    places, levels_db = reading.heard[0].places, reading.levels_db
    count = len(places.east_m)
    held, level_db = _over_levels(logs, levels_db)
    each = (np.exp(held - held.max()) * places.area).sum(axis=0)
    ground = LikelyGround(
        bearing_deg=places.bearing_deg,
        range_m=np.hypot(places.east_m, places.north_m),
        width_deg=np.full(count, BEARING_STEP_DEG),
        ratio=np.full(count, RANGE_STEP),
        uneven=np.full(count, np.inf),
        logs=held,
        level_db=level_db,
    )
    for _ in range(PLACE.most_rounds):
        which = ground.to_part()
        if not len(which):
            break
        parts = ground.parts(which)
        from_here = east_north(parts.bearing_deg, parts.range_m)
        found = _all_logs(reading, from_here, falls=len(logs) > 1)
        held, level_db = _over_levels(found, levels_db)
        ground = ground.with_parts(which, replace(parts, logs=held, level_db=level_db))
    held = ground.shifted
    believed = held[held.sum(axis=1) >= PLACE.least_exponent_share]
    cells = Cells(
        plane=places.plane,
        bearing_deg=ground.bearing_deg,
        range_m=ground.range_m,
        width_deg=ground.width_deg,
        ratio=ground.ratio,
        probability=held.sum(axis=0),
        by_fall=believed / believed.sum(axis=1, keepdims=True),
    )
    return cells, float((held * ground.level_db).sum()), each / each.sum()


def _summary(
    probability: _Floats, level_db: float, fading_db: float, cells: Cells
) -> PlaceBelief:
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
        fading_db=fading_db,
        probability=probability,
        cells=cells,
    )
