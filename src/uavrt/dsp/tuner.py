"""Choose a radio frequency at which all tags can be received.

The default keeps all tags within the decimator's span without aliases, widened if needed. It
keeps them away from the radio's centre, where a zero-IF receiver has its DC spur. Then it
avoids mirror images (an IQ imbalance shows a tag at +f also at -f), and puts the tags near
channel centres. Among such frequencies it prefers those that the original system's tuner rates
no worse than its own choice. The plan then also suits that system's detectors.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import TunerError, UsageError
from uavrt.dsp.plan import BandPlan, check_rate, plan_band

DC_GUARD_HZ = 1000.0
"""Minimum distance of a tag from the radio's centre [Hz]: twice the search window."""

IMAGE_GUARD_HZ = 1000.0
"""Preferred distance of a tag from another's mirror image [Hz]: two search windows."""

GRID_STEP_HZ = 100.0
FLAT_FRACTION = 0.85
"""Share of a channel that the original system considers flat; the rest are two shoulders."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TunerPlan:
    """A radio frequency and the resulting channel, offset and warnings for each tag, in the
    order of the tags.
    """

    center_frequency_hz: float
    channels: tuple[int, ...]
    """Channel number of each tag, from 0 (the original system counts from 1)."""
    offsets_hz: tuple[float, ...]
    """Distance of each tag from its channel's centre [Hz]."""
    shares_channel: bool
    """True if two or more tags share a channel."""
    image_pairs: tuple[tuple[int, int], ...]
    """Pairs of tags, as indices, in which each tag lies on the other's mirror image."""
    band_rate_hz: float
    channel_count: int
    warnings: tuple[str, ...]
    """Sentences for the operator on tags nearer to the centre or an image than allowed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CompatibleCost:
    """Costs that the original system's tuner minimises, in the order of their priority."""

    tags_per_channel: Floats
    """Mean number of tags per occupied channel, shape (candidates,), for each candidate radio
    frequency."""
    edge_cost: Floats
    """Summed costs of tags near channel edges, shape (candidates,); infinite if a tag lies on
    an edge."""
    mean_offset_hz: Floats
    """Mean distance of the tags from channel centres [Hz], shape (candidates,)."""


def tune(
    frequencies_hz: Sequence[float],
    *,
    sample_rate_hz: float = 3_000_000.0,
    channel_count: int | None = None,
) -> TunerPlan:
    """Choose the radio's frequency, to one hertz.

    Parameters
    ----------
    frequencies_hz : sequence of float
        Frequencies of the tags [Hz].
    sample_rate_hz : float
        Rate of the radio [Hz].
    channel_count : int, optional
        Channels across the band; as `FrontEnd` chooses by default.

    Raises
    ------
    TunerError
        No frequency serves all the tags; the text says which tags and what to do.
    UsageError
        No tags, or frequencies that cannot be hertz.
    """
    check_rate(sample_rate_hz)
    tags = _checked(frequencies_hz)
    if channel_count is not None and channel_count % 2:
        raise UsageError(
            f"the number of channels {channel_count} is not supported",
            remedy="Use an even number of channels",
        )
    band = plan_band(sample_rate_hz, reach_hz=float(np.ptp(tags)) / 2.0)
    while True:
        count = channel_count or band.channel_count
        try:
            center = _best_center(tags, band, count)
        except TunerError:
            if band.decimation_factor == 1:
                raise
            wider_hz = band.usable_half_span_hz + 1.0
            band = plan_band(sample_rate_hz, reach_hz=wider_hz)
        else:
            return _plan(tags, center, band.band_rate_hz / count, count)


def compatible_cost(
    tags_hz: Floats, centers_hz: Floats, *, spacing_hz: float, channel_count: int
) -> CompatibleCost:
    """Cost of candidate radio frequencies, computed as in the original system's tuner.

    Let w be half a shoulder, 7.5 % of the channel. A tag at distance d from its channel's edge
    costs ``|w / d - 1|`` if d < w, and nothing otherwise.
    """
    offsets = tags_hz - centers_hz[:, None]
    channels = _nearest_channels(offsets, spacing_hz, channel_count)
    from_center = np.abs(offsets - channels * spacing_hz)
    to_edge = np.rint(spacing_hz / 2 - from_center)
    half_shoulder = spacing_hz * (1 - FLAT_FRACTION) / 2
    with np.errstate(divide="ignore"):
        cost = np.where(to_edge < half_shoulder, np.abs(half_shoulder / to_edge - 1), 0.0)
    # A tag right on an edge belongs to the channel below.
    counted = np.sort(np.ceil(offsets / spacing_hz - 0.5), axis=1)
    occupied = 1 + np.count_nonzero(np.diff(counted, axis=1), axis=1)
    return CompatibleCost(
        tags_per_channel=tags_hz.size / occupied,
        edge_cost=cost.sum(axis=1),
        mean_offset_hz=from_center.mean(axis=1),
    )


def _checked(frequencies_hz: Sequence[float]) -> Floats:
    tags = np.array(list(frequencies_hz), dtype=np.float64)
    if tags.size == 0:
        raise UsageError(
            "the tag list is empty, so no radio frequency can be chosen",
            remedy="List at least one tag",
        )
    wrong = [f"{f:g}" for f in tags if not (np.isfinite(f) and f >= 1e5)]
    if wrong:
        raise UsageError(
            f"the tag frequencies {', '.join(wrong)} Hz are not possible",
            remedy="Give frequencies in hertz (148.71 MHz is 148710000)",
        )
    return np.rint(tags)


def _nearest_channels(offsets: Floats, spacing_hz: float, channel_count: int) -> Floats:
    half = channel_count // 2
    highest = half - 1 if channel_count > 1 else 0
    nearest: Floats = np.clip(np.rint(offsets / spacing_hz), -half, highest)
    return nearest


def compatible_candidates(tags: Floats, spacing: float, channel_count: int) -> Floats:
    """Radio frequencies among which the original system's tuner chooses [Hz]."""
    low, high = tags.min(), tags.max()
    grid = np.arange(low, high, GRID_STEP_HZ) if high > low else np.array([low])
    below = (channel_count // 2 + 0.5) * spacing
    above = (channel_count // 2 - 0.5) * spacing if channel_count > 1 else spacing / 2
    fits: Floats = grid[(grid - below <= low) & (high <= grid + above)]
    return fits


def _candidates(tags: Floats, spacing: float, low: float, high: float) -> Floats:
    """Radio frequencies in [low, high] among which the best choice lies [whole Hz].

    A grid, and the points where a cost has its kinks: tags on a channel centre (the mean offset
    is piecewise linear), at the edge of a guard, at the start of a shoulder.
    """
    steps = np.arange(np.floor((low - tags[0]) / spacing), (high - tags[0]) / spacing + 2)
    flat = spacing * FLAT_FRACTION / 2
    kinks = [
        np.arange(low, high, GRID_STEP_HZ),
        np.array([low, high, tags.mean()]),
        tags - DC_GUARD_HZ,
        tags + DC_GUARD_HZ,
    ]
    # Beyond some tens of tags the centres alone are as dense as the grid.
    shifts = (0.0, -flat, flat) if tags.size <= 12 else (0.0,)
    residues = np.unique(np.mod(tags - tags[0], spacing))[:100]
    kinks.extend(
        (tags[0] + residues[:, None] + shift + steps * spacing).ravel() for shift in shifts
    )
    middles = _middles(tags)
    if middles.size <= 100:
        kinks += [middles - IMAGE_GUARD_HZ / 2, middles + IMAGE_GUARD_HZ / 2]
    points = np.concatenate(kinks)
    # Both neighbours in whole hertz: a guard may be met on one side only.
    points = np.unique(np.concatenate((np.floor(points), np.ceil(points))))
    chosen: Floats = points[(points >= low) & (points <= high)]
    return chosen


def _middles(tags: Floats) -> Floats:
    """Mid-points of all pairs of tags [Hz], sorted; a radio centred on one shows each tag of
    the pair at the other's mirror image.
    """
    first, second = np.triu_indices(tags.size, 1)
    middles: Floats = np.sort((tags[first] + tags[second]) / 2)
    return middles


def _best_center(tags: Floats, band: BandPlan, channel_count: int) -> float:
    spacing, half_span = band.band_rate_hz / channel_count, band.usable_half_span_hz
    low, high = np.ceil(tags.max() - half_span), np.floor(tags.min() + half_span)
    if low > high:
        raise _too_wide(tags, 2 * half_span)
    original = compatible_candidates(tags, spacing, channel_count)
    points = _candidates(tags, spacing, low, high)
    points = np.union1d(points, original[(original >= low) & (original <= high)])
    tags = np.sort(tags)
    # Distance from DC: only the two neighbours in the sorted tags can be nearest.
    after = np.searchsorted(tags, points)
    nearest = np.minimum(
        np.abs(points - tags[np.minimum(after, tags.size - 1)]),
        np.abs(points - tags[np.maximum(after - 1, 0)]),
    )
    kept = nearest >= DC_GUARD_HZ
    points, nearest = points[kept], nearest[kept]
    if points.size == 0:
        raise _no_room(tags, low, high)

    middles = _middles(tags)
    images = np.searchsorted(middles, points + IMAGE_GUARD_HZ / 2, "left")
    images -= np.searchsorted(middles, points - IMAGE_GUARD_HZ / 2, "right")
    # A spur at DC is inside channel 0 and on the skirts of its two neighbours.
    from_dc = np.where(nearest < spacing / 2, 2, np.where(nearest < 1.5 * spacing, 1, 0))
    cost = compatible_cost(tags, points, spacing_hz=spacing, channel_count=channel_count)
    per_channel, edge = cost.tags_per_channel.round(9), cost.edge_cost.round(9)
    worse = np.ones(points.size, dtype=bool)
    if original.size:
        theirs = _original_cost(tags, original, spacing, channel_count)
        worse = (per_channel > theirs[0]) | ((per_channel == theirs[0]) & (edge > theirs[1]))
    ranks: list[NDArray[np.float64 | np.intp]] = [
        np.abs(points - tags.mean()),
        cost.mean_offset_hz.round(),
        from_dc,
        images,
    ]
    if worse.all():
        # Guards have a cost: choose the allowed frequency nearest to the original's optimum.
        ranks += [edge, per_channel]
    ranks.append(worse)
    return float(points[np.lexsort(ranks)[0]])


def _original_cost(
    tags: Floats, candidates: Floats, spacing: float, channel_count: int
) -> tuple[float, float]:
    cost = compatible_cost(tags, candidates, spacing_hz=spacing, channel_count=channel_count)
    per_channel = cost.tags_per_channel.round(9)
    best = per_channel.min()
    return float(best), float(cost.edge_cost.round(9)[per_channel == best].min())


def _plan(tags: Floats, center: float, spacing: float, channel_count: int) -> TunerPlan:
    relative = tags - center
    signed = _nearest_channels(relative, spacing, channel_count)
    offsets = relative - signed * spacing
    channels = tuple(int(channel) % channel_count for channel in signed)
    pairs = tuple(
        (i, j)
        for i, j in combinations(range(tags.size), 2)
        if abs(relative[i] + relative[j]) < IMAGE_GUARD_HZ
    )
    warnings = tuple(
        f"{_mhz(tags[i])} and {_mhz(tags[j])} MHz lie on each other's mirror image"
        for i, j in pairs
    )
    return TunerPlan(
        center_frequency_hz=center,
        channels=channels,
        offsets_hz=tuple(float(offset) for offset in offsets),
        shares_channel=len(set(channels)) < len(channels),
        image_pairs=pairs,
        band_rate_hz=spacing * channel_count,
        channel_count=channel_count,
        warnings=warnings,
    )


def _mhz(frequency_hz: float) -> str:
    return f"{frequency_hz / 1e6:.6f}"


def _too_wide(tags: Floats, span_hz: float) -> TunerError:
    low, high = tags.min(), tags.max()
    return TunerError(
        f"the tags span {(high - low) / 1e3:.1f} kHz, from {_mhz(low)} to {_mhz(high)} MHz, "
        f"but the radio receives only {span_hz / 1e3:.1f} kHz at a time",
        remedy="Search them in two flights, leave the outermost tag out, or use a radio with a "
        "higher sample rate",
    )


def _no_room(tags: Floats, low: float, high: float) -> TunerError:
    return TunerError(
        f"no radio frequency between {_mhz(low)} and {_mhz(high)} MHz keeps {DC_GUARD_HZ:g} Hz "
        f"from each of the {tags.size} tags",
        remedy="Leave out a tag near the middle or an outermost one, or set the radio's "
        "frequency by hand (center_frequency_hz)",
    )
