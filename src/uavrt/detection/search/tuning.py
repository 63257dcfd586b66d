"""Constants of the search for groups of pulses: one frozen record for each step.

Tables by K are calibrated (docs/explanation/detection.md). Powers are in noise powers.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SpectrogramTuning:
    """Constants of the spectrogram of a narrow band."""

    blas_product: int = 200_000
    """Maximum number of multiplications in a matrix product that OpenBLAS computes in one
    thread; with two threads it may take 50 times as long."""
    least_window: int = 24
    """Minimum length of a pulse after decimation [samples]; below it the hop is too coarse."""
    stopband_db: float = 55.0
    """Attenuation of aliases by the filter that decimates to the tag's band [dB]."""
    kernel_window: int = 254
    """Maximum pulse length for which the compiled transform is used [samples]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseTuning:
    """Constants for estimating the noise of each row of the grid."""

    excluded_ratio: float = 4.0
    """Power above which a cell does not count as noise [noise powers]; 1.8 % of noise cells
    exceed it."""
    step_gain: float = 1.31
    """Factor that speeds up the iteration of the noise power: 1 / (1 - slope of the
    iteration)."""
    long_s: float = 20.0
    """Time constant of the slow estimate of the noise power [s]."""
    short_s: float = 1.0
    """Time constant of the fast noise average, which shows a rise of the noise [s]."""
    rise_ratio: float = 2.2
    """Ratio of fast to slow noise average above which the fast one is used; pulses cause a
    ratio of 1.3."""
    settle_s: float = 2.0
    """Time between two comparisons of a row's noise power with its neighbours' [s]."""
    young_s: float = 8.0
    """Duration at the start in which the noise is averaged over `young_reach` rows [s]."""
    young_reach: int = 24
    """Number of rows averaged on each side at first; an error of 5 % doubles the false
    alarms."""
    reach: int = 8
    """Number of rows on each side from which a row's broadband noise is estimated: two bins."""
    flat_ratio: float = 1.2
    """Ratio of the spread of the noise medians to their error, up to which a spectrum counts as
    flat. A tilt of 0.4 dB over the band may be missed, which is within the error of the
    medians."""
    steep_errors: float = 4.0
    """Difference between the noise medians on both sides of a row above which the row is at an
    edge of the spectrum [standard errors]. If all rows lie on a line there is no edge, and the
    median is correct."""
    least_steep: float = 0.15
    """Minimum relative difference of the noise medians on both sides of an edge: 0.7 dB."""
    edge_flat_ratio: float = 1.5
    """Ratio of the spread of the noise levels on one side of an edge to their error, up to
    which that side counts as flat."""
    hum_sigmas: float = 0.5
    """Excess over the median [standard deviations] above which a row's own noise estimate is
    used, as between lines of hum. It raises the noise by 3 to 5 %. With the median there were
    3.4 times the nominal false groups."""
    usual_threshold: float = 25.0
    """Typical threshold of a group's sum, used to compute the effect of uncertain noise [noise
    powers]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseLevelTuning:
    """Constants for following sudden changes of the noise, in slots of half a pulse."""

    most_power: float = 4.0
    """Limit on the power of a cell in an estimate of the noise level [noise powers]."""
    past_slots: int = 80
    """Number of past slots of half a pulse, from which noise levels are estimated."""
    stretches: tuple[int, ...] = (6, 10, 16, 26, 42, 80)
    """Numbers of slots (half pulses) over which noise is averaged; the smallest one locates
    steps."""
    most_splits: int = 4
    """Maximum number of divisions of the bands into groups of different noise levels."""
    split_log: float = 6.5
    """Minimum log-likelihood ratio for two groups of bands to have different noise levels."""
    differ_sigmas: float = 2.2
    """Minimum difference between the means of different noise levels [standard deviations]."""
    slot_variance: float = 1.5
    """Ratio of the variance of power in half a pulse to its squared mean, in one bin."""
    doubt_sigmas: float = 3.0
    """Change of all bands together that marks a new noise level [standard deviations]."""
    band_doubt_sigmas: float = 3.6
    """Change of a single band that marks a new noise level [standard deviations]."""
    piece_slots: int = 11
    """Number of slots (half pulses) in a piece compared with the mean noise level."""
    pulse_ratio: float = 1.7
    """Minimum ratio of the power of a half-pulse slot to that of the slots on both sides, for a
    strong pulse."""
    pulse_sigmas: float = 2.6
    """Excess of three half-pulse slots that marks a weak pulse [standard deviations]."""
    beside_slots: tuple[int, int] = (4, 8)
    """Distances from a pulse at which slots are compared with it [slots of half a pulse]."""
    median_slots: int = 11
    """Number of slots (half pulses) in the running median that limits a band's cells."""
    newest_slots: int = 10
    """Number of newest half-pulse slots in which the noise level is at least the lower bound of
    recent means."""
    most_margin: float = 0.3
    """Maximum fraction added to an uncertain noise level for the search."""
    same_share: float = 0.12
    """Relative difference below which two noise levels count as the same."""
    most_averaged: int = 40
    """Maximum number of updates over which an unchanged noise level is averaged."""
    learnt_slots: int = 40
    """Number of slots (half pulses) of noise level 1 assumed before the first slot."""
    steady_ratio: float = 0.5
    """Ratio of the lowest to the highest noise level from which cells need no new limits."""
    least_level: float = 1e-9
    """Minimum noise level [noise powers]; avoids division by zero if samples are zero."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupTuning:
    """Constants for summing cells to groups, and choosing candidates."""

    cell_limit: float = 14.0
    """Limit on the power of a cell in the sum of a group [noise powers]: half of the threshold
    at K = 3. So no single impulse makes a group. The limit costs no sensitivity, since it
    lowers sums of noise as much (measured: docs/explanation/detection.md)."""
    piece_s: float = 0.46
    """Longest piece of spectrogram columns searched at once [s]; a detector passes pieces of
    0.44 s."""
    measured_columns: int = 4
    """Number of columns, half a pulse width, that must follow the last pulse of a group. The
    flank of a strong pulse reaches the cell limit before the pulse's maximum."""
    score_digits: int = 4
    """Number of decimal places to which candidates' scores are compared. Strong groups have
    equal scores because cells are limited before the sum; rounding errors must not choose
    between them."""
    anchors_at_once: int = 96
    """Number of strong cells (anchors) tested by one call of NumPy."""
    candidates_at_once: int = 24
    """Maximum number of candidate groups that are measured at once; the strongest are chosen.
    The flanks of a neighbour 10 dB above the tag fill eight of these places; 36 pulses were
    once missed next to it."""
    long_from_k: int = 9
    """Smallest K (number of pulses in a group) for which every cell is tried as the last pulse,
    and not only strong cells."""
    long_candidates_at_once: int = 8
    """Maximum number of candidates for long groups measured at once; each takes up to 10 ms."""
    same_bins: float = 1.5
    """Frequency difference below which a known pulse explains a candidate's pulse [bins]."""
    leak_share: float = 0.2
    """Minimum leakage of a known pulse that explains a candidate [share of its strength]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThresholdTuning:
    """Constants of the thresholds for white noise."""

    least_power: float = 13.0
    """Minimum power of a burst [noise powers]; noise in 3.75 kHz has it every six seconds."""
    tail_step: float = 0.01
    """Resolution of the calculated distribution of a group's sum of powers [noise powers]."""
    original_rate_hz: float = 3750.0
    """Sample rate of the original detector [Hz]; false-alarm rates are defined by the
    original's decisions."""
    finer_per_bin: float = 0.2
    """Increase of the number of independent times by each bin over which a pulse's frequency
    slides; computed for 0 to 16 bins by filtering white noise (Rice's rate of upcrossings)."""
    most_finer: float = 1.55
    """Largest increase of the number of independent times by a slide, in the spectrogram: eight
    columns per pulse are then independent."""
    nine_of_ten: float = 1.2816
    """Quantile of the normal distribution for a probability of 0.9 [standard deviations]."""
    least_begun: float = 0.25
    """Minimum time in which a group may begin [decision intervals]; for K up to 40 it is
    longer."""
    first_share: float = 0.8
    """Calibrated share of groups completely within the first decision's samples."""
    noise_error: float = 0.033
    """Relative error of the noise estimate after 2.5 s, with which the threshold tables were
    calibrated."""
    ks: tuple[float, ...] = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 40.0)
    """Numbers of pulses K for which `hypotheses` and `interval_powers` are given."""
    hypotheses: tuple[float, ...] = (19.5, 36.0, 40.0, 46.0, 94.0, 94.0, 56.0, 139.0)
    """Effective number of hypotheses per independent cell and interval, by K."""
    interval_powers: tuple[float, ...] = (1.0, 1.40, 1.40, 1.42, 1.36, 1.57, 1.60, 1.60)
    """Exponent of the number of intervals in the number of hypotheses, by K."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NullTuning:
    """Constants for counting groups formed by the present noise, which raise the threshold."""

    counted_share: float = 0.93
    """Share of the threshold above which groups of noise are counted. They are then frequent
    enough to be counted within ten seconds, and similar to those that reach the threshold. At
    0.85, varying sparks caused 1.5 times the nominal false groups, because their tail falls
    slowly."""
    cell_share: float = 0.15
    """Share c in a cell's limit in a counted group, which is c + (1 - c) / K of the threshold.
    With the higher limit of the search, each pulse of a weak tag formed groups with noise, and
    the tag's own threshold rose by 0.1 to 0.2 dB (K = 3)."""
    # Range of the intervals tried, relative to the tag's; two of the shortest exceed the tag's.
    shortest_share: float = 0.58
    longest_share: float = 0.86
    lattices: int = 12
    """Number of intervals, all different from the tag's, at which groups are counted."""
    gain: float = 0.08
    """Rise of the threshold by each group counted at another interval [noise powers]."""
    # Soon after coloured noise begins, a counted group adds `eager_gain` / (`eager_groups` +
    # groups expected since then), as in stochastic approximation. With 1.6, the mean excess of
    # a group in such noise, the threshold rises faster, but a tag of 14 dB next to a carrier
    # loses 1 % of its pulses.
    eager_gain: float = 0.7
    """Rise of the threshold by the first group counted in new coloured noise [noise powers]."""
    eager_groups: float = 3.0
    """Number of further groups counted in coloured noise after which each raises the threshold
    by half as much."""
    by_chance: float = 0.4
    """Rise of the threshold that counts in white noise make by chance [noise powers]; it is
    subtracted."""
    most_share: float = 0.85
    """Maximum of the raised threshold, as a share of the largest possible sum of K cells. It is
    limited because strong pulses of other transmitters are counted as well, and they must not
    hide a strong tag."""
    tolerated_ratio: float = 1.3
    """Ratio of the number of counted groups to that in white noise, up to which the threshold
    is not raised."""
    tolerated_coloured_ratio: float = 1.0
    """Ratio of the number of counted groups to that in white noise, up to which the threshold
    is not raised while noise is coloured."""
    ks: tuple[float, ...] = (2.0, 3.0, 5.0, 8.0)
    """Numbers of pulses K for which `white_ratios` are given."""
    white_ratios: tuple[float, ...] = (0.92, 1.25, 1.75, 1.56)
    """Measured ratio of counted groups in white noise to the computed number, by K."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceTuning:
    """Constants for testing candidates near the threshold by their likelihood."""

    power_limit: float = 16.0
    """Limit on the power of a cell in a group's likelihood [noise powers]; it bounds the effect
    of impulses."""
    table_step: float = 0.02
    """Step in power of the table of likelihood ratios of pulse to noise [noise powers]."""
    steps_per_pulse: int = 25
    """Number of start times tried per pulse width; between two of them, a pulse's power falls
    by a twelfth."""
    row_bins: float = 0.125
    """Step of the frequencies tried around the candidate's, for its likelihood [bins]."""
    frequencies: int = 5
    """Number of frequencies tried around the candidate's."""
    jitter_share: float = 0.4
    """Standard deviation of a pulse's jitter, as a share of the tag's declared jitter."""
    gate: float = 0.9
    """Minimum score of a candidate for its likelihood to be tested, as a share of the
    threshold."""
    sure_score: float = 1.2
    """Score above which a candidate is accepted without a test of its likelihood: that of two
    cells at the limit and one above the noise."""
    tested_k: int = 3
    """Number of pulses K in the groups that are tested by their likelihood."""
    most_jitter_widths: float = 6.0
    """Largest jitter of a tag whose groups are tested by their likelihood [pulse widths]; at
    this limit 45 000 lattices (series of pulse times) are summed in a millisecond."""
    factor_log: float = -3.7
    """Constant of the minimum log-likelihood ratio, from noise groups counted at K = 3."""
    slope: float = 1.2
    """Factor on the log of the false-alarm probability in the minimum log-likelihood ratio."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasureTuning:
    """Constants for measuring single pulses in the samples."""

    track_band_hz: float = 20.0
    """Maximum frequency difference between a followed pulse and its track [Hz]."""
    newton_steps: int = 3
    """Maximum number of steps of Newton's method that refine a pulse's frequency."""
    burst_sigmas: float = 9.0
    """Excess energy of a quarter of a pulse that marks an impulse [standard deviations]."""
    burst_share: float = 0.65
    """Minimum share of a pulse's energy in one quarter of it that marks an impulse."""
    wide_sigmas: float = 6.0
    """Excess energy of a window above which its spectrum is checked [standard deviations]."""
    narrow_share: float = 0.35
    """Minimum share of a pulse's energy in its strongest row; noise bursts have 0.1 to 0.3."""
    slides_hz: tuple[float, ...] = (-400.0, -200.0, 0.0, 200.0, 400.0)
    """Changes of frequency within a pulse that are tried before it counts as a burst of noise,
    and to measure a tag's slide [Hz]; the frequency changes evenly."""
    around_widths: float = 4.0
    """Time around a pulse over which the median power gives the noise [pulse widths]."""
    break_places: tuple[float, ...] = (0.25, 0.5, 0.75)
    """Positions in a pulse at which its phase may break, as shares of its width."""
    break_gain: float = 3.5
    """Power that noise gains because the best position of a phase break is chosen [noise
    powers]; it is subtracted."""
    losing_s: float = 0.3
    """Time from lost samples within which a pulse may have a break of phase [s]."""


GRID = SpectrogramTuning()
NOISE = NoiseTuning()
LEVEL = NoiseLevelTuning()
GROUPS = GroupTuning()
THRESHOLDS = ThresholdTuning()
NULL = NullTuning()
EVIDENCE = EvidenceTuning()
MEASURE = MeasureTuning()
