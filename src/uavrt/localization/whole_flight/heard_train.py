"""Find the slots that contain a folded train's pulses, and compute the likelihood ratio of
their energies.

A slot's energy in noise is the largest of m unit exponential variables; their mean gives m,
which depends on jitter and slot. A pulse of energy S makes two of them, the windows that
contain most of it, noncentral chi-square variables with 2 degrees of freedom (constant
amplitude, unknown phase).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, ndimage, special, stats

from uavrt.localization.tuning import LEVELS
from uavrt.localization.whole_flight.drifting import train_times_s
from uavrt.localization.whole_flight.energies.coded_bursts_over_flight import (
    exponentials,
    log_ratio_parts,
)
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.flight_judgement import FoldedTrain
from uavrt.localization.whole_flight.tag_places import Places
from uavrt.localization.whole_flight.tuning import PLACE

_Floats = NDArray[np.float64]
AMPLITUDES = np.arange(0.0, 22.05, 0.1)
"""Pulse amplitudes in the likelihood tables, in units of the noise, up to 27 dB. A stronger
pulse and its expected strength are reduced by the same factor, since noise changes it by less
than 0.3 dB."""
STRENGTHS_DB = np.arange(-40.0, 44.0, 0.5)
"""Expected strengths of pulses in the likelihood tables: energy over noise [dB]."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrainPulses:
    """Times and energies of the slots in which a train's pulses are expected."""

    time_s: _Floats
    """Times of expected pulses relative to the start of the first slot [s], shape (n,)."""
    energy: _Floats
    """Energies in the slots of expected pulses, in units of the noise, shape (n,)."""
    noise_db: _Floats
    """Noise at each pulse relative to its median [dB], by which the energies were divided,
    shape (n,)."""
    interval_s: float
    offset_hz: float
    pulses: int = 1
    """Number of pulses in a burst, over which each energy is averaged."""


def train_pulses(
    energies: SlotEnergies, train: FoldedTrain, gain: _Floats, gain_time_s: _Floats
) -> TrainPulses:
    """Refine a train between the cells of the search; return the energies of its slots."""
    slot_s, slots = energies.slot_s, energies.energy.shape[1]
    span_s = slots * slot_s
    count = int((span_s - train.phase_s) / train.interval_s) + 1
    weight = np.ones(slots)
    if not train.loud:  # its marks do not depend on the position
        weight = np.interp(energies.time_s, gain_time_s, gain / (0.5 + gain))
    step_s = slot_s / max(count - 1, 1)
    row = int(np.argmin(np.abs(energies.offsets_hz - train.offset_hz)))
    rows = range(max(0, row - 1), min(len(energies.energy), row + 2))
    row_energies = {near: limited_energies(energies, near) for near in rows}
    best, kept = -np.inf, (row, train.phase_s, train.interval_s)
    for interval_s in train.interval_s + step_s * np.linspace(-1.5, 1.5, 13):
        for phase_s in train.phase_s + slot_s * np.linspace(-1.5, 1.5, 13):
            time_s = train_times_s(phase_s, interval_s, train.drift, span_s)
            at = np.floor(time_s / slot_s).astype(np.intp)
            at = at[(at >= 0) & (at < slots)]
            for near in rows:
                score = float(weight[at] @ row_energies[near][at])
                if score > best:
                    best, kept = score, (near, float(phase_s), float(interval_s))
    row, phase_s, interval_s = kept
    time_s = train_times_s(phase_s, interval_s, train.drift, span_s)
    at = np.floor(time_s / slot_s).astype(np.intp)
    good = (at >= 0) & (at < slots)
    good[good] = (energies.heard | energies.loud[row])[at[good]]
    noise_db = energies.noise_db[at[good]]
    return TrainPulses(
        time_s=time_s[good],
        energy=energies.level[row, at[good]].astype(np.float64),
        noise_db=noise_db - np.median(noise_db) if len(noise_db) else noise_db,
        interval_s=interval_s,
        offset_hz=float(energies.offsets_hz[row]),
        pulses=energies.pulses,
    )


def limited_energies(energies: SlotEnergies, row: int) -> NDArray[np.float32]:
    """Energies at one frequency, in which those of strong pulses are compressed
    logarithmically.
    """
    energy = energies.energy[row].copy()
    loud = energies.loud[row] & ~energies.heard
    energy[loud] = (
        np.log(energies.level[row, loud]) * PLACE.loud_factor - energies.mean[row]
    ) / (energies.sigma[row])
    return np.asarray(energy)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeardTrain:
    """Pulse train in one flight, and the candidate positions of its tag."""

    pulses: TrainPulses
    mean_noise_energy: float
    """Mean energy of a slot that contains only noise [noise energies of a window]."""
    places: Places
    log_trains: float | None = None
    """Logarithm of the number of trains from which this one was chosen as the best; None if it
    is certainly the tag's. A weak train may be chance, and the flight then gives no
    information."""
    rates: int = 1
    """Number of the tag's pulse rates; with several, another rate may have been used in some
    slots."""

    def of_walker(self, velocity_m_s: tuple[float, float], at_s: float) -> "HeardTrain":
        """Train of a tag that walks; positions are those at a time `at_s`."""
        track = self.places.track.seen_from(velocity_m_s, self.places.time_s - at_s)
        return replace(self, places=replace(self.places, track=track))

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
        """Create the record of a train that was found, with the statistics of noise at its
        frequency.
        """
        row = int(np.argmin(np.abs(energies.offsets_hz - pulses.offset_hz)))
        quiet = energies.away_from(pulses.time_s)
        mean = energies.mean[row]
        if pulses.pulses == 1 and np.count_nonzero(quiet) >= PLACE.least_quiet:
            mean = energies.level[row, quiet].mean()
        return cls(
            pulses=pulses,
            mean_noise_energy=float(mean),
            places=places,
            log_trains=log_trains,
            rates=rates,
        )


def slot_logs(one: HeardTrain, gain: _Floats, levels_db: _Floats) -> _Floats:
    """Log likelihood ratio of a pulse in each slot, shape (levels, slots)."""
    table = likelihood_table(one)
    column, beyond_db = table_columns(one.pulses.energy)
    gain_db = 10.0 * np.log10(gain + 1e-9) - beyond_db
    strength = np.rint(
        (gain_db + levels_db[:, np.newaxis] - STRENGTHS_DB[0]) / PLACE.strength_step_db
    )
    strength = np.clip(strength, 0, len(table) - 1).astype(np.intp)
    return np.asarray(table[strength, column])


def table_columns(energy: _Floats) -> tuple[NDArray[np.intp], _Floats]:
    """Return columns of `likelihood_table` for energies, and by how much the energies exceed
    the table [dB].
    """
    amplitude = np.sqrt(np.maximum(energy, 0.0))
    beyond_db = 20.0 * np.log10(np.maximum(amplitude / AMPLITUDES[-1], 1.0))
    column = np.rint(np.minimum(amplitude, AMPLITUDES[-1]) / AMPLITUDES[1])
    return column.astype(np.intp), beyond_db


def noise_reaches(one: HeardTrain, share: float) -> float:
    """Energy of a slot that noise alone exceeds in the given share of slots."""
    pulses, mean = one.pulses.pulses, one.mean_noise_energy
    many = _exponentials(mean) if pulses == 1 else exponentials(mean, pulses)
    return float(special.gammaincinv(pulses, (1.0 - share) ** (1.0 / many)) / pulses)


def likelihood_table(one: HeardTrain, fading_db: float = PLACE.fadings_db[0]) -> _Floats:
    """Log likelihood ratios of the energies of a train's pulses, shape (strengths,
    amplitudes).
    """
    pulses, mean = one.pulses.pulses, one.mean_noise_energy
    many = _exponentials(mean) if pulses == 1 else exponentials(mean, pulses)
    finer = np.arange(
        STRENGTHS_DB[0], STRENGTHS_DB[-1] + 0.5 * PLACE.strength_step_db, PLACE.strength_step_db
    )
    logs = _log_ratios(many, pulses, fading_db)
    return np.asarray(interpolate.CubicSpline(STRENGTHS_DB, logs)(finer))


def _exponentials(mean: float) -> float:
    """Number m of unit exponential variables whose maximum has the given mean: H(m) = mean."""
    many = np.linspace(1.0, 12.0, 1101)
    means = special.digamma(many + 1.0) + np.euler_gamma
    return float(many[int(np.argmin(np.abs(means - mean)))])


def _log_ratios(many: float, pulses: int, fading_db: float) -> _Floats:
    """Log likelihood ratio of a slot's energy, shape (strengths, amplitudes).

    For a coded tag, E is the mean energy of a burst's pulses, and one of the m windows may
    contain the burst. The ratio is f/(m e^-E) + (m-1)/m F/(1-e^-E), with f and F of one pulse.
    Fading affects all pulses of a burst equally.
    """
    energy = np.maximum(AMPLITUDES, 0.1) ** 2
    if pulses == 1:
        ratio = _pulse_ratio(energy, many)
    else:
        strength = 10.0 ** (STRENGTHS_DB / 10.0)[:, np.newaxis]
        density, law = log_ratio_parts(energy, strength, pulses)
        ratio = density / many + (many - 1.0) / many * law
    step = STRENGTHS_DB[1] - STRENGTHS_DB[0]
    usual, odd = (
        ndimage.gaussian_filter1d(ratio, one_db / step, axis=0, mode="nearest")
        for one_db in (fading_db, max(fading_db, PLACE.odd_fading_db))
    )
    ratio = (
        (1.0 - 2.0 * LEVELS.outlier_share) * usual
        + LEVELS.outlier_share * odd
        + LEVELS.outlier_share
    )
    return np.asarray(np.maximum(np.log(ratio), PLACE.least_log))


def _pulse_ratio(energy: _Floats, many: float) -> _Floats:
    """Likelihood ratio of the largest of m exponential variables, two of which may contain a
    pulse.

    f is the density of a window's energy divided by that of noise, F its distribution function,
    and N = 1 - e^-E. The ratio is (f1 F2^q + q f2 F1 F2^(q-1))/(m N^q) + (m-1-q)/m F1
    F2^q/N^(1+q). q is 1, and falls to 0 as m falls to 1.
    """
    below = -np.expm1(-energy)
    (first, first_law), (second, second_law) = (
        _pulse_law(energy, part) for part in PLACE.windows
    )
    both = min(1.0, many - 1.0)
    law = np.maximum(second_law, 1e-300) ** both
    ratio = first * law + both * second * first_law * law / np.maximum(second_law, 1e-300)
    ratio /= many * below**both
    return np.asarray(
        ratio + (many - 1.0 - both) / many * first_law * law / below ** (1.0 + both)
    )


def _pulse_law(energy: _Floats, part: float) -> tuple[_Floats, _Floats]:
    """Density, divided by that of noise, and distribution function of the energy of a window
    that contains part of a pulse.

    `part` is the share of the pulse's energy in the window.
    """
    strength = part * 10.0 ** (STRENGTHS_DB / 10.0)[:, np.newaxis]
    x = 2.0 * np.sqrt(energy * strength)
    # Bounded: energies this far above noise are certain.
    density = np.exp(np.minimum(x - strength + np.log(special.i0e(x)), 600.0))
    return density, np.asarray(stats.ncx2.cdf(2.0 * energy, 2, 2.0 * strength))
