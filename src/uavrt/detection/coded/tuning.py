"""Constants of the detection of coded tags: one frozen record for each step.

Energies are in units of a noise cell's mean. Measurements: docs/explanation/coded-tags.md.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class CellTuning:
    """Constants for computing and storing the energies of a channel."""

    row_spacing: float = 0.3125
    """Spacing of the searched frequencies [1 / pulse width]: 125 Hz. A pulse half-way between
    two loses 0.3 dB."""
    columns_per_pulse: float = 9.0
    """Number of columns of cells (time steps) per pulse width."""
    noise_pieces: int = 25
    """Number of stretches of samples, 10 s in all; their median powers give the noise level."""
    least_rise: float = 0.85
    """Minimum noise level, as a share of the newest estimate, so that a rise of the noise is
    not taken for a burst."""
    kept_s: float = 130.0
    """Duration for which spectrogram cells are stored, to sum several bursts [s]."""
    step_s: float = 0.4
    """Duration of the samples collected before the search for bursts continues [s]."""
    # Limits for cells that are excluded from sums of several bursts.
    tall: float = 25.0
    """Energy of a cell above which sums of several bursts leave it out [noise energies]."""
    echoing: float = 200.0
    """Energy of a cell above which the filters produce an echo of it [noise energies]."""
    echo_widths: int = 5
    """Duration of an echo of the filters [pulse widths]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SumTuning:
    """Constants for sums of spectrogram cells: over the pulses of one coded burst, and over
    several bursts of a code.
    """

    stretches: tuple[float, ...] = (0.0, -0.5, 0.5, -1.0, 1.0)
    """Stretches of a burst's gaps that are tried, as shares of their common tolerance."""
    apart_columns: int = 4
    """Distance within which only the largest sum of a code and frequency is kept [columns]."""
    most_cell: float = 10.0
    """Limit on the energy of a cell in a sum of several bursts [noise energies]."""
    # Mean cell of a seed. Three of four sums of bursts at the limit contain a cell of this
    # size; noise has few.
    seed_of_many: float = 3.5
    seed_of_three: float = 4.3
    columns_per_step: float = 2.0
    """Shift of a sum's last burst from one tried burst interval to the next [columns]."""
    few_bursts: int = 3
    """Number of bursts in the smaller of the two sums over several bursts of a code."""
    examined_share: float = 0.88
    """Ratio of a sum of bursts to the required sum above which the sum is refined."""
    clear_lead: float = 20.0
    """Difference between the sums of two codes with common pulses above which the smaller is
    excluded [noise energies]."""
    box_columns: int = 2048
    """Length of the time ranges in which waiting possible bursts are grouped [columns]."""
    same_columns: int = 10
    """Maximum time between pulses of two codes that count as the same pulse [columns]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RefineTuning:
    """Constants for refining nearly sufficient sums of bursts on the samples."""

    turns_hz: tuple[float, ...] = (-42.0, 0.0, 42.0)
    """Offsets tried from the spectrogram row's frequency [Hz]: a third of the row spacing."""
    stretches: tuple[float, ...] = (-0.25, 0.0, 0.25)
    """Further stretches of a burst's gaps that are tried, as shares of the gaps' tolerance."""
    shifts: tuple[float, ...] = (-1.0, -0.5, 0.0, 0.5, 1.0)
    """Shifts in time that are tried for all bursts of a sum together [columns]."""
    drifts: tuple[float, ...] = (-1.0, 0.0, 1.0)
    """Shifts in time tried for a sum's last burst relative to the first [columns]."""
    near_columns: int = 3
    """Distance from cells replaced by noise at which a pulse counts as hidden [columns]."""
    hidden_energy: float = 0.25 * math.pi
    """Energy assumed for a hidden pulse [noise energies]: (mean amplitude)² of noise."""
    margin_columns: int = 6
    """Number of columns on each side of a pulse for which samples are read to refine the
    pulse."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitTuning:
    """Constants that relate required sums to the allowed false identifications."""

    false_per_hour: float = 1e-4
    """False identifications allowed from noise, per code [1/h]."""
    # Shares of the false alarms; the rest is for the longest sums.
    share_of_one: float = 0.4
    share_of_three: float = 0.2
    per_cell: float = 60.0
    """Number of independent sums for each time-frequency area of one pulse width times its
    inverse."""
    per_interval: float = 1.0
    """Number of independent burst intervals tried for each pulse width by which the time of the
    last burst is uncertain."""
    per_refinement: float = 14.0
    """Number of independent sums tried while one sum of bursts is refined."""
    expected_false: float = 1e-6
    """Probability that noise is taken for a known tag's burst, in a cell where one is due."""
    expected_log: float = 6.0
    """Log odds that an identified tag's burst comes when expected, not at another time."""
    least_energy: float = 0.25
    """Minimum mean energy of a reported burst's pulses over the noise [noise energies]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LikelihoodTuning:
    """Assumptions for the evidence that pulses are those of a listed code."""

    fading: float = 0.12
    """Relative standard deviation of the pulse amplitudes in a burst without noise; an
    assumption."""
    coincidence: float = 0.05
    """Assumed probability that a pulse of another code lies where a pulse is expected: 3 ms of
    a gap of 57 ms."""
    least_hit: float = 1e-3
    """Minimum probability that a pulse of any sender lies where the code's pulse is
    expected."""
    hiding_amplitude: float = 0.5
    """Minimum amplitude of a signal that hides a pulse, relative to the pulse."""
    place_s: float = 1e-3
    """Maximum deviation of a pulse from its expected time in the burst [s]."""
    sums_tried: float = 20.0
    """Number of independent sums of several bursts that are tried; the largest is used."""
    strengths_log: float = 5.0
    """Log of the ratio of the largest to the smallest amplitude that a pulse may have."""
    alignments: float = 16.0
    """Number of ways to align one of a burst's four pulses with one of four positions."""
    least_log: float = 4.0
    """Minimum log-likelihood ratio of the listed code to unlisted codes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapeTuning:
    """Constants that decide if the pulses of a sum are a burst."""

    pool_columns: int = 1
    """Distance from a pulse's expected column within which its peak counts [columns]."""
    leak_amplitude: float = 0.35
    """Amplitude, relative to the strongest simultaneous signal, up to which a signal may be
    leakage of it."""
    loud_energy: float = 20.0
    """Minimum energy of a signal for its leakage to be considered [noise energies]."""
    rounded: float = 1.0 - 1e-6
    """Share of the required sum below which a possible burst is dropped; it is slightly below 1
    to allow for rounding errors."""
    least_amplitude: float = 0.33
    """Minimum amplitude of a pulse relative to another of the same burst."""
    hit_amplitude: float = 0.5
    """Minimum amplitude of a signal that hides a pulse, relative to the burst's usual one."""
    higher_amplitude: float = 2.3
    """Excess that noise may add to a cell close to a pulse's cell [noise amplitudes]."""
    beside_amplitude: float = 0.6
    """Maximum amplitude just outside a pulse, relative to the pulse, without noise."""
    end_widths: tuple[float, float] = (1.2, 3.2)
    """Two distances from a pulse [pulse widths]; at one of them the energy must have fallen."""
    aside_s: float = 0.75e-3
    """Maximum deviation of a strong pulse from its expected time in the burst [s]. With a
    greater value, the flanks of 20 dB pulses would match another code whose gaps differ by 4.5
    ms in total."""
    aside_noise_s: float = 3e-3
    """Deviation that noise adds to `aside_s` at amplitude 1 [s]; it falls with amplitude."""
    flank_amplitude: float = 0.8
    """Maximum amplitude of a flank relative to its pulse; a larger signal is a pulse."""
    guard_s: float = 0.5e-3
    """Duration of the filters' ringing beyond a pulse width [s]."""
    clear_log: float = 10.0
    """Minimum log-likelihood lead of a code over all codes with the same pulses."""
    most_swaps: int = 3
    """Maximum rounds of replacing accepted bursts by others that explain more pulses."""
    sure_pulses: int = 2
    """Minimum number of undisturbed pulses in a burst reported without identification."""
    sure_energy: float = 12.0
    """Minimum pulse energy of a burst reported without identification [noise energies]."""
    nowhere: int = -(2**40)
    """Column number that stands for a pulse that is missing."""
    saturated_energy: float = 12.0
    """Energy at which stored cells no longer show a pulse's maximum [noise energies]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentityTuning:
    """Constants for identifying a tag by its burst interval, and predicting its next burst."""

    steps: int = 8
    """Number of burst intervals, before and after, over which bursts are compared."""
    missed_log: float = 1.0
    """Log-likelihood that a tag loses where a burst is missing at its interval; most bursts are
    detected."""
    clear_log: float = 3.0
    """Minimum lead in log-likelihood of one tag's burst interval over the intervals of other
    tags."""
    timing_s: float = 1e-3
    """Error of the measured start of a burst [s]."""
    wait_intervals: float = 2.2
    """Time for which an ambiguous burst waits for later bursts to identify it [burst
    intervals]."""
    doubt_log: float = math.log(100.0)
    """Maximum amount by which the log-likelihood ratio may be too small for a burst to be
    reported as unconfirmed."""
    rows: int = 1
    """Maximum frequency difference between bursts of one tag [frequency rows]."""
    most_missed: int = 8
    """Maximum number of bursts missed before a tag must be identified again."""
    own_error: float = 5e-6
    """Relative error of a tag's measured burst interval, because its crystal drifts with
    temperature."""
    same_burst_s: float = 0.02
    """Maximum difference between the start times in two reports of one burst [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignTuning:
    """Constants for counting bursts that no listed code explains."""

    least_per_hour: float = 0.02
    """Rate of unknown senders' bursts assumed before any is received on a channel [1/h]."""
    memory_s: float = 300.0
    """Time over which the rate of unknown senders' bursts is averaged [s]."""
    start_s: float = 10.0
    """Time that is added to the time since the start [s], so that one early burst does not
    cause a high rate."""
    weakest_energy: float = 10.0
    """Minimum energy of each of three pulses of an unknown sender's burst [noise energies]."""
    sure_energy: float = 14.0
    """Minimum energy of a single pulse of an unknown sender [noise energies]."""
    beside_share: float = 0.25
    """Minimum energy of an extra pulse that contradicts a burst, relative to the burst's mean
    pulse energy."""
    rows: int = 2
    """Maximum frequency difference between pulses of one unknown sender [frequency rows]."""


CELLS = CellTuning()
SUMS = SumTuning()
REFINE = RefineTuning()
LIMITS = LimitTuning()
LIKELIHOOD = LikelihoodTuning()
SHAPE = ShapeTuning()
IDENTITY = IdentityTuning()
FOREIGN = ForeignTuning()
