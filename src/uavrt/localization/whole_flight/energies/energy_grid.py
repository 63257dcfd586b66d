"""Convert a channel's samples to energies on a grid of time slots and frequencies.

A slot is a quarter or a half of a pulse. Its energy is the largest matched-filter power of the
windows that begin in it or within the tag's jitter of it. Energies are standardised: mean 0 and
variance 1 in noise, 0 without samples. Signals that are strong enough to be detected alone are
excluded with their surroundings, so that no single event looks like a train. Those that have
the shape of a pulse and not of an impulse are marked, and trains of marks are also searched
for.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.detection.search.grid import Grid, Spectrogram, make_grid, sliding_maximum
from uavrt.dsp.zero_runs import zero_runs
from uavrt.localization.number_kinds import Resolution
from uavrt.localization.whole_flight.energies.coded_bursts_over_flight import (
    SinglePulses,
    burst_columns,
    pulse_starts_s,
)
from uavrt.localization.whole_flight.tuning import ENERGY


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlotEnergies:
    """Standardised energy of each time slot at each frequency."""

    energy: NDArray[np.float32]
    """Energy in time slots, shape (frequencies, slots): mean 0 and variance 1 in noise, 0
    without samples."""
    heard: NDArray[np.bool_]
    """True for time slots with samples and without a strong signal nearby, shape (slots,)."""
    offsets_hz: NDArray[np.float64]
    """Offset from the tag's nominal frequency [Hz], shape (frequencies,)."""
    start_ns: int
    """Time at which the first slot begins [ns, UTC]."""
    slot_s: float
    mean: NDArray[np.float64]
    """Mean energy of a slot before standardisation, in units of the noise, shape
    (frequencies,)."""
    sigma: NDArray[np.float64]
    left_out: int
    """Number of time steps excluded because a strong signal was received."""
    level: NDArray[np.float32]
    """Maximum power over noise, including strong pulses, shape (frequencies, slots); 0 if
    excluded."""
    loud: NDArray[np.bool_]
    """True where a slot contains a pulse strong enough to be detected alone, shape
    (frequencies, slots)."""
    listened: NDArray[np.bool_]
    """True for time slots in which there were samples, shape (slots,)."""
    noise_db: NDArray[np.float64]
    """Noise by which each slot's energies were divided [dB], shape (slots,); it may vary with
    the heading."""
    pulses: int = 1
    """Number of pulses averaged in each energy: those of a coded tag's burst, 1 for an uncoded
    tag."""
    single: SinglePulses | None = None
    """Energies of single pulses of a coded tag; None for an uncoded tag."""

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Middles of the slots relative to `start_ns` [s], shape (slots,)."""
        return np.asarray((np.arange(len(self.heard)) + 0.5) * self.slot_s)

    @property
    def end_ns(self) -> int:
        """Time at which the last slot ends [ns, UTC]."""
        length_s = len(self.heard) * self.slot_s
        return self.start_ns + round(length_s * NANOSECONDS_PER_SECOND)

    def between(self, first: int, end: int) -> "SlotEnergies":
        """Return a copy with only the slots from one index to another, which are not
        standardised again.
        """
        start_s = first * self.slot_s
        return replace(
            self,
            energy=self.energy[:, first:end],
            heard=self.heard[first:end],
            start_ns=self.start_ns + round(start_s * NANOSECONDS_PER_SECOND),
            level=self.level[:, first:end],
            loud=self.loud[:, first:end],
            listened=self.listened[first:end],
            noise_db=self.noise_db[first:end],
            single=_joined_singles([self], first, end),
        )

    def away_from(self, time_s: NDArray[np.float64]) -> NDArray[np.bool_]:
        """True for slots that have an energy and are not near times (n,) after `start_ns` [s],
        shape (slots,).
        """
        return self.heard & self._beyond(time_s)

    def _beyond(self, time_s: NDArray[np.float64]) -> NDArray[np.bool_]:
        gone = np.zeros(len(self.heard), bool)
        at = np.floor(time_s / self.slot_s).astype(np.intp)
        for shift in range(-ENERGY.slots_beside, ENERGY.slots_beside + 1):
            inside = at + shift
            gone[inside[(inside >= 0) & (inside < len(gone))]] = True
        return ~gone

    def without(self, time_s: NDArray[np.float64]) -> "SlotEnergies":
        """Return a copy without the energies near given times (n,) after `start_ns` [s]."""
        return self.where(self._beyond(time_s))

    def where(self, kept: NDArray[np.bool_]) -> "SlotEnergies":
        """Return a copy with only the energies of the selected slots (slots,)."""
        return replace(
            self,
            energy=np.where(kept, self.energy, np.float32(0.0)),
            heard=self.heard & kept,
            level=np.where(kept, self.level, np.float32(0.0)),
            loud=self.loud & kept,
            listened=self.listened & kept,
        )


def joined(parts: Sequence[SlotEnergies]) -> SlotEnergies:
    """Join the energies of consecutive parts of a flight, and standardise them as a whole.

    Excluded columns around a part's slots are counted with that part.
    """
    first = parts[0] if parts else None
    if first is None:
        raise ValueError("there are no energies to join")
    level = np.concatenate([one.level for one in parts], axis=1)
    heard = np.concatenate([one.heard for one in parts])
    energy, mean, sigma = _centred(
        np.where(heard, level, np.float32(0.0)), heard, round(ENERGY.level_s / first.slot_s)
    )
    return replace(
        first,
        energy=energy,
        heard=heard,
        mean=mean,
        sigma=sigma,
        left_out=sum(one.left_out for one in parts),
        level=level,
        loud=np.concatenate([one.loud for one in parts], axis=1),
        listened=np.concatenate([one.listened for one in parts]),
        noise_db=np.concatenate([one.noise_db for one in parts]),
        single=_joined_singles(parts),
    )


def _joined_singles(
    parts: Sequence[SlotEnergies], first: int = 0, end: int | None = None
) -> SinglePulses | None:
    known = [one.single for one in parts if one.single is not None]
    if not known:
        return None
    return SinglePulses(
        level=np.concatenate([one.level[:, first:end] for one in known], axis=1),
        starts_s=known[0].starts_s,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotLayout:
    """Numbers of samples, columns and time slots into which a tag's channel is divided."""

    grid: Grid
    columns_per_slot: int
    reach: int
    """Number of time columns on each side of a slot's middle in which its pulse is searched
    for."""
    beyond: int = 0
    """Number of time columns from the first to the last pulse of a burst."""

    @property
    def samples_per_slot(self) -> int:
        """Number of samples from one slot to the next."""
        return self.columns_per_slot * self.grid.hop

    @property
    def slots_beside(self) -> int:
        """Number of slots on each side of a time span whose samples affect the energies in the
        span.
        """
        columns = (
            2 * self.reach + 2 * ENERGY.hops_beside + -(-self.grid.window // self.grid.hop)
        )
        columns += self.beyond
        return math.ceil(columns / self.columns_per_slot) + 2


def slot_layout(
    tag: Tag,
    *,
    sample_rate_hz: float,
    center_frequency_hz: float,
    frequency_window_hz: float,
    slots_per_pulse: Resolution[int] = 2,
) -> SlotLayout:
    """Divide a tag's channel into time slots; the parameters are those of `slot_energies`."""
    grid = make_grid(
        sample_rate_hz=sample_rate_hz,
        pulse_width_s=tag.pulse_width_s,
        offset_hz=tag.frequency_hz - center_frequency_hz,
        half_width_hz=frequency_window_hz,
        slide_hz=tag.frequency_slide_hz,
    )
    per_slot = max(1, round(tag.pulse_width_s / slots_per_pulse / grid.hop_s))
    half_s = 0.5 * per_slot * grid.hop_s
    reach = math.ceil((tag.interval_jitter_s + half_s) / grid.hop_s - 0.5)
    beyond = math.ceil(1.05 * sum(tag.gaps_s) / grid.hop_s)
    return SlotLayout(grid=grid, columns_per_slot=per_slot, reach=reach, beyond=beyond)


def gather(
    blocks: Iterable[tuple[NDArray[np.complex64], int]], sample_rate_hz: float
) -> tuple[NDArray[np.complex64], NDArray[np.bool_], int]:
    """Join blocks by time; return samples (0 if missing), True where samples exist, and the
    start [ns].

    Overlaps, as caused by a fast crystal, are removed. If the clock was set back or changed by
    hours, the change is ignored.
    """
    parts: list[NDArray[np.complex64]] = []
    gaps: list[tuple[int, int]] = []
    start_ns = end = set_by = 0
    least = max(2.0, ENERGY.least_step_s * sample_rate_hz)
    for samples, time_ns in blocks:
        if not len(samples):
            continue
        if not parts:
            start_ns = time_ns
        due = round((time_ns - start_ns) / NANOSECONDS_PER_SECOND * sample_rate_hz)
        gap = due - end - set_by
        if (
            not -ENERGY.most_overlap_s * sample_rate_hz
            <= gap
            < ENERGY.most_gap_s * sample_rate_hz
        ):
            set_by += gap  # the clock was set
            gap = 0
        if gap >= least:
            gaps.append((end, end + gap))
            parts.append(np.zeros(gap, np.complex64))
            end += gap
        elif gap <= -least:
            samples = samples[-gap:]
        parts.append(np.asarray(samples, np.complex64))
        end += len(samples)
    whole = np.concatenate(parts) if parts else np.zeros(0, np.complex64)
    there = np.ones(len(whole), bool)
    for low, high in gaps:
        there[low:high] = False
    return whole, there, start_ns


def slot_energies(
    samples: NDArray[np.complex64],
    there: NDArray[np.bool_],
    *,
    tag: Tag,
    start_ns: int,
    sample_rate_hz: float,
    center_frequency_hz: float,
    frequency_window_hz: float,
    slots_per_pulse: Resolution[int] = 2,
) -> SlotEnergies:
    """Measure the energy of each time slot; `samples`, `there` and `start_ns` are results of
    `gather`.
    """
    layout = slot_layout(
        tag,
        sample_rate_hz=sample_rate_hz,
        center_frequency_hz=center_frequency_hz,
        frequency_window_hz=frequency_window_hz,
        slots_per_pulse=slots_per_pulse,
    )
    grid, per_slot, reach = layout.grid, layout.columns_per_slot, layout.reach
    there = there & ~_dead(samples, round(ENERGY.dead_s * sample_rate_hz))
    channel = _channel_noise(samples, there, round(ENERGY.channel_s * sample_rate_hz))
    samples = np.asarray(samples / np.sqrt(channel), np.complex64)
    hop, columns = grid.hop, len(samples) // grid.hop
    # Rows a quarter of a bin apart; every second loses 0.1 dB in the mean (sinc² at 1/8 bin).
    rows = np.arange(grid.rows // 2 % 2, grid.rows, 2)
    power = _row_powers(samples, grid, rows)
    whole = _whole_windows(there, hop, grid.window, columns)
    loud, noise_db = _standardise(power, whole, round(ENERGY.level_s / grid.hop_s))
    noise_db += 10.0 * np.log10(channel[: columns * hop : hop])
    crest, wide = _channel_columns(samples, hop, grid.window, columns, sample_rate_hz)
    top = power.max(axis=0) if columns else np.zeros(0, np.float32)
    pulse = loud & (crest <= ENERGY.crest * np.maximum(top, ENERGY.loud_power))
    loud |= wide & whole
    power[:, ~whole] = 0.0
    seen = (power > ENERGY.loud_power) & pulse
    quiet = ~(~whole | _spread(loud, ENERGY.hops_beside))
    single = power
    if tag.coded:
        bursts = burst_columns(power, seen, quiet, whole, tag, grid.hop_s)
        power, seen = bursts.power, bursts.seen
        quiet, whole = bursts.heard, bursts.listened
    heard = ~_spread(~quiet, reach)
    count = max(0, (columns - 2 * reach - per_slot) // per_slot)
    # Slot s begins at column s × per_slot + reach; the search is around its middle.
    at = np.arange(count) * per_slot + per_slot // 2
    level = _tops(power, reach, at)
    marked = _tops(seen.astype(np.float32), reach, at) > 0.0
    good = heard[at + reach]
    energy = np.where(good, level, np.float32(0.0))
    energy, mean, sigma = _centred(
        energy, good, round(ENERGY.level_s / (per_slot * grid.hop_s))
    )
    return SlotEnergies(
        energy=energy,
        heard=good,
        offsets_hz=grid.offsets_hz[rows] - (tag.frequency_hz - center_frequency_hz),
        start_ns=start_ns + round(reach * grid.hop_s * NANOSECONDS_PER_SECOND),
        slot_s=per_slot * grid.hop_s,
        mean=mean,
        sigma=sigma,
        left_out=int(np.count_nonzero(loud)),
        level=level,
        loud=marked,
        listened=~_spread(~whole, reach)[at + reach],
        noise_db=noise_db[at + reach],
        pulses=1 + len(tag.gaps_s),
        single=None
        if not tag.coded
        else SinglePulses(level=_tops(single, reach, at), starts_s=pulse_starts_s(tag)),
    )


def _row_powers(
    samples: NDArray[np.complex64], grid: Grid, rows: NDArray[np.int_]
) -> NDArray[np.float32]:
    """Power of the matched filter in some rows of the grid, shape (rows, columns)."""
    spectrogram = Spectrogram(grid)
    chunk = max(round(ENERGY.chunk_s * grid.sample_rate_hz), 4 * grid.window)
    columns = len(samples) // grid.hop
    power = np.zeros((len(rows), columns), np.float32)
    done = 0
    while done < columns:
        first = spectrogram.needed()
        if first >= len(samples) + chunk:
            break
        new = spectrogram.push(_zeros_around(samples, first, first + chunk))
        count = min(len(new), columns - done)
        if not count and first >= len(samples):
            break
        power[:, done : done + count] = new[:count, rows].T
        done += count
    return power


def _dead(samples: NDArray[np.complex64], least: int) -> NDArray[np.bool_]:
    """True for samples in runs of at least `least` samples that are exactly zero."""
    dead = np.zeros(len(samples), bool)
    for first, end in zero_runs(samples, least):
        dead[first:end] = True
    return dead


def _channel_noise(
    samples: NDArray[np.complex64], there: NDArray[np.bool_], length: int
) -> NDArray[np.float32]:
    """Noise power of the whole channel at each sample, up to a constant factor.

    It is the median over time and frequency in spans of `length` samples, interpolated between
    their middles. Impulses, pulses and hum hardly change it, because strong samples are
    limited and a frame resolves narrow lines (8 Hz in spans of half a second).
    """
    many = ENERGY.channel_frames
    frame = length // many
    count = len(samples) // frame
    frames = samples[: count * frame].reshape(count, frame)
    size = np.abs(frames)
    limit = 2.0 * np.median(size, axis=1, keepdims=True)
    part = np.minimum(size, limit) / np.maximum(size, np.float32(1e-30))
    power = np.abs(np.fft.fft(frames * part * np.hanning(frame).astype(np.float32))) ** 2
    whole = np.asarray(there[: count * frame].reshape(count, frame).all(axis=1))
    middles, levels = [], []
    for first in range(0, count, many):
        some = np.flatnonzero(whole[first : first + many]) + first
        level = float(np.median(power[some])) if len(some) else 0.0
        if level > 0.0:
            middles.append((some.mean() + 0.5) * frame)
            levels.append(level)
    if not levels:
        return np.ones(len(samples), np.float32)
    return np.interp(np.arange(len(samples)), middles, levels).astype(np.float32)


def _zeros_around(
    samples: NDArray[np.complex64], first: int, end: int
) -> NDArray[np.complex64]:
    before, after = max(0, -first), max(0, end - max(first, len(samples)))
    part = samples[max(first, 0) : max(end, 0)]
    return np.pad(part, (before, after)) if before or after else part


def _tops(power: NDArray[np.float32], reach: int, at: NDArray[np.intp]) -> NDArray[np.float32]:
    tops = sliding_maximum(np.ascontiguousarray(power.T), reach).T if reach else power
    return np.ascontiguousarray(tops[:, at])


def _channel_columns(
    samples: NDArray[np.complex64], hop: int, window: int, columns: int, sample_rate_hz: float
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the maximum sample power over noise in each time column, and True where the whole
    channel is strong.
    """
    crest, wide = np.zeros(columns, np.float32), np.zeros(columns, bool)
    length = max(1, round(ENERGY.level_s * sample_rate_hz / hop))
    beyond = -(-window // hop)
    for low in range(0, columns, length):
        high = min(low + length, columns)
        more = min(high + beyond, columns)
        end = len(samples) if more == columns else more * hop
        part = samples[low * hop : max(end, min(high * hop + window, len(samples)))]
        power = part.real**2 + part.imag**2
        first = np.arange(more - low) * hop
        total = np.zeros(len(power) + 1)
        np.cumsum(power, out=total[1:])
        at = first[: high - low]
        some = total[np.minimum(at + window, len(power))] - total[at]
        there = some[some > 0.0]
        peaks = np.maximum.reduceat(power, first)
        largest = peaks.copy()
        for later in range(1, min(beyond, len(peaks))):
            largest[:-later] = np.maximum(largest[:-later], peaks[later:])
        crest[low:high] = largest[: high - low]
        if not len(there):
            continue
        middle = float(np.median(there))
        sigma = 1.4826 * float(np.median(np.abs(there - middle)))
        wide[low:high] = some > middle + ENERGY.wide_sigmas * sigma
        crest[low:high] /= max(middle / window, 1e-30)
    return crest, wide


def _whole_windows(
    there: NDArray[np.bool_], hop: int, window: int, columns: int
) -> NDArray[np.bool_]:
    whole = np.ones(columns, bool)
    whole[max(0, (len(there) - window) // hop + 1) :] = False
    missing = np.flatnonzero(~there)
    breaks = np.flatnonzero(np.diff(missing) > 1)
    firsts = missing[np.concatenate(([0], breaks + 1))] if len(missing) else missing
    ends = missing[np.concatenate((breaks, [-1]))] + 1 if len(missing) else missing
    for low, high in zip(firsts.tolist(), ends.tolist(), strict=True):
        whole[max(0, -(-(low - window + 1) // hop)) : -(-high // hop)] = False
    return whole


def _standardise(
    power: NDArray[np.float32], whole: NDArray[np.bool_], length: int
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Divide powers by the noise of each row and time; return the strong columns and the noise
    [dB].
    """
    columns = power.shape[1]
    loud, noise_db = np.zeros(columns, bool), np.zeros(columns)
    side = ENERGY.level_rows // 2
    for part in _stretches(columns, length):
        some, good = power[:, part], whole[part]
        if np.count_nonzero(good) < length // 8:
            loud[part] = True  # too few samples to estimate the noise
            some[:] = 0.0
            continue
        medians = np.median(some[:, good], axis=1)
        levels = np.array(
            [
                np.median(medians[max(0, row - side) : row + side + 1])
                for row in range(len(medians))
            ]
        )
        some /= np.maximum(levels / math.log(2.0), 1e-30)[:, np.newaxis].astype(np.float32)
        loud[part] = some.max(axis=0) > ENERGY.loud_power
        noise_db[part] = 10.0 * np.log10(max(float(np.median(levels)), 1e-30))
    return loud & whole, noise_db


def _stretches(count: int, length: int) -> list[slice]:
    first = range(0, max(count - length // 2, 1), length)
    return [slice(low, min(low + length, count)) for low in first[:-1]] + [
        slice(first[-1], count)
    ]


def _spread(flags: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    counts = np.concatenate(([0], np.cumsum(flags)))
    at = np.arange(len(flags))
    low, high = np.maximum(at - reach, 0), np.minimum(at + reach + 1, len(flags))
    return np.asarray(counts[high] > counts[low])


def _centred(
    energy: NDArray[np.float32], good: NDArray[np.bool_], length: int
) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.float64]]:
    """Shift energies to mean 0 in each time span, and scale rows to variance 1.

    Also returns the rows' original means and their standard deviations before scaling.
    """
    result = np.zeros_like(energy)
    rows = len(energy)
    if not good.any():
        return result, np.zeros(rows), np.ones(rows)
    mean = energy[:, good].mean(axis=1, dtype=np.float64)
    for part in _stretches(energy.shape[1], length):
        heard = good[part]
        if heard.any():
            some = energy[:, part][:, heard]
            result[:, part][:, heard] = some - some.mean(axis=1, keepdims=True)
    sigma = np.maximum(result[:, good].std(axis=1, dtype=np.float64), 1e-6)
    result /= sigma[:, np.newaxis].astype(np.float32)
    return result, mean, sigma
