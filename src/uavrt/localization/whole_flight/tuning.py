"""Constants of the search of a whole flight, in one frozen record for each step.

Figures of noise and of positions are measured by `uavrt experiment integrate`.
"""

from dataclasses import dataclass

from uavrt.localization.number_kinds import Guard, Resolution


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergyTuning:
    """Constants for converting samples to slot energies, without strong or lost samples."""

    block_s: Guard[float] = 30.0
    """Duration of samples that are measured together in flight [s], five times `level_s`."""
    chunk_s: Guard[float] = 6.0
    """Duration of a channel's samples that are processed at once [s]."""
    level_s: float = 6.0
    """Time over which the shape of the noise over frequency is assumed constant [s]."""
    channel_s: Resolution[float] = 0.5
    """Time over which the noise of the whole channel is assumed constant [s]. An antenna that
    turns by 30° a second turns by 15°; the estimate's error is 0.2 dB."""
    channel_frames: Resolution[int] = 4
    """Number of frames into which this time is divided. A burst of noise in one of them hardly
    changes their median."""
    level_rows: int = 5
    """Number of neighbouring frequencies whose noise power is averaged."""
    loud_power: float = 20.0
    """Minimum power over noise of a filter window that counts as strong; noise reaches it in
    one window of 5e8. The fading of a train is estimated if its strongest pulses reach it."""
    wide_sigmas: float = 8.0
    """Excess of the whole channel's energy from which it contains a strong signal [standard
    deviations]. Without it, a tag 30 dB stronger and 500 Hz away is reported in 9 of 10
    flights."""
    crest: float = 3.0
    """Ratio of the largest sample power in a window to the window's matched-filter power, both
    over noise, above which the window contains an impulse. The ratio is 1/N for a pulse of N
    samples, and N for an impulse."""
    hops_beside: int = 16
    """Distance from a strong filter window beyond which other windows are used [hops]: two
    pulses."""
    slots_beside: int = 4
    """Time slots on each side of a pulse's slot into which the pulse and its jitter may extend
    [slots]."""
    most_gap_s: Guard[float] = 7200.0
    """Longest gap between two blocks of samples that is bridged [s]."""
    most_overlap_s: Guard[float] = 0.1
    """Largest overlap of a block with earlier ones that is attributed to drift [s]. A crystal
    that is 100 ppm fast reaches it in 17 minutes; a clock set back by more is ignored."""
    least_step_s: Guard[float] = 0.0015
    """Minimum time step between sample blocks that is corrected [s]; each correction loses one
    window."""
    dead_s: Guard[float] = 0.1
    """Minimum duration of exact zeros that indicates a dead radio or a filled gap [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchTuning:
    """Constants for finding pulse trains over positions, intervals, frequencies and drifts."""

    # Possible tag positions: bearings, and rings between two radii [m]; time step [s].
    bearings: Resolution[int] = 72
    nearest_m: Guard[float] = 40.0
    farthest_m: Guard[float] = 5000.0
    ranges: Resolution[int] = 14
    step_s: Resolution[float] = 0.25
    same_place_correlation: Resolution[float] = 0.97
    """Correlation between the weights of two positions from which one represents both, with a
    loss of 0.13 dB."""
    design_enr: float = 2.0
    """Energy over noise of the strongest pulse for which the slot weights are optimal, 2 (3
    dB)."""
    kept_variance: Resolution[float] = 0.995
    """Share of the slot weights' variance that the folded patterns contain, with a loss of 0.01
    dB."""
    few_patterns: Guard[int] = 8
    """Maximum number of weight patterns for which all positions are folded at once."""
    # Variance and correlation for the patterns and places that choose cells to examine in full:
    # three times fewer of both. A train of 7 standard deviations has 5.6 there at worst.
    coarse_variance: Resolution[float] = 0.90
    coarse_correlation: Resolution[float] = 0.85
    examined_cells: Guard[int] = 400
    """Number of cells (train hypotheses) that are examined in full, the best of tens of
    thousands. In twenty minutes of noise, the last of them has 5.0 to 5.4 standard
    deviations."""
    side_by_side: Guard[int] = 48
    """Number of train sums (frequencies times patterns) that are folded at once, using 60 MB.
    An addition takes 0.8 ns with NumPy on the reference computer, and 1.9 ns with 12 sums."""
    gain_block: Guard[int] = 16_000
    """Number of antenna gains (positions × times) that are computed at once, to fit in the
    processor's cache."""
    moment_slots: Guard[int] = 16384
    least_skewness: Guard[float] = 0.02
    hypotheses: float = 6.0
    """Number of independent train hypotheses for each pattern and cell, measured in flights
    with noise only."""
    burst_hypotheses: float = 2.5
    """Factor on `hypotheses` for coded tags, whose bursts are each the best of several
    stretches."""
    lags: Resolution[tuple[int, ...]] = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
    """Lags at which the correlation of a frequency's slot energies is computed [slots]."""
    # Trains of strong pulses: hypotheses for each cell of marks, chosen such that these trains
    # cause 2 % of the false alarms, minimum number of marks, share of the best log probability
    # above which another train may have the same marks, and weight for central slots, below
    # that of any mark.
    loud_hypotheses: float = 75.0
    least_marks: Guard[int] = 4
    same_marks_share: float = 0.95
    middle_weight: float = 0.4

    drift_step_slots: Resolution[float] = 6.0
    """Shift in mid-flight between two searched drifts of the interval [slots]. A train half-way
    between is shifted by a quarter of it, less than a double slot. A step of 4 would gain 0.05
    dB."""
    drift_independent_slots: float = 5.0
    """Shift of pulses in mid-flight from which a drift of the interval counts as a new trial
    [slots]. In 400 flights of noise, false alarms were 0.93 times the nominal number; with 2
    slots, 0.44 times."""
    drift_patterns: Guard[int] = 3
    drift_correlation: Resolution[float] = 0.9
    drift_cells: Guard[int] = 120
    """Number of train hypotheses with interval drift that are examined in full."""

    # Another train that explains one: log of the factor by which it must be less likely by
    # chance, and range of its intervals relative to the one found.
    explains_log: float = 3.0
    shortest_ratio: Guard[float] = 0.3
    longest_ratio: Guard[float] = 3.2
    # Ratios of small numbers that count as the same interval, and how nearly.
    small_number: Guard[int] = 3
    same_ratio: float = 0.01
    # Maximum other trains and other codes removed before a tag counts as not found.
    most_others: Guard[int] = 4
    most_codes: Guard[int] = 12

    # Several flights: allowed relative difference of the interval between them, minimum number
    # of cells of the shortest flight's fold in such a stretch, and maximum frequency error of a
    # tag in one flight, relative to its mean [rows] (25 Hz at 20 ms).
    stretch: float = 2e-4
    least_cells: float = 2.0
    rows_beside: Guard[int] = 1
    stretch_hypotheses: float = 8.6
    """Number of independent train hypotheses for each flight and cell of a range of
    intervals."""
    place_hypotheses: float = 1.35
    """Number of independent train hypotheses for each pattern and flight, if the tag moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceTuning:
    """Constants for estimating a tag's position from a train's energies, and the position's
    uncertainty.
    """

    # Levels examined, relative to the strongest energies [dB], and parts of a step of 1 dB.
    levels_db: Resolution[tuple[float, float]] = (-14.0, 9.0)
    level_parts: Resolution[int] = 8
    strength_step_db: Resolution[float] = 0.1
    """Step between two pulse strengths in the likelihood table [dB]. At 0.5 dB the pulses of a
    flight line are rounded equally, and this alone makes positions 20 m apart differ."""
    most_rounds: Guard[int] = 4
    likely_places: Guard[int] = 100
    """Number of likely positions over which the probability is averaged that a flight's train
    is the tag's."""
    # Work done at once: places times pulses, places of several rates, and pairs of cells.
    block: Guard[int] = 20_000
    rates_block: Guard[int] = 300
    pair_rows: Guard[int] = 200
    most_heading_sigmas: Guard[float] = 3.0
    """Largest error common to all headings that is considered [standard deviations]."""
    exponents: Resolution[tuple[float, ...]] = (2.0, 2.5, 3.0, 3.5, 4.0)
    """Candidate path loss exponents, from free space to a tag on the ground."""
    same_range_db: Guard[float] = 0.3
    """Variation of 10 log10(distance) below which the path loss exponent cannot be estimated
    [dB]."""
    least_exponent_share: Guard[float] = 0.02
    """Minimum probability from which a path loss exponent is considered, so that regions
    contain the tag under it."""
    counted: float = 0.8
    """Share of the pulses' evidence that is used, because neighbouring pulses have common
    errors of pattern, poses and ground. With all evidence, 90 % regions contained 85 % of the
    tags (I4)."""
    lasting_db2: float = 4.0
    """Variance of level errors common to neighbouring pulses, multiplied by the number of
    pulses for which they last [dB²]. It limits the evidence of pulses with little noise and
    fading. Without it, 90 % arcs of strong tags are 16 % narrower."""
    noisy_db2: float = 10.0
    """Largest variance of a pulse's level by noise up to which the full share `counted` applies
    [dB²]. Without it, 90 % arcs of weak tags are 10 % wider."""

    fadings_db: Resolution[tuple[float, ...]] = (1.0, 2.0, 3.0, 4.5)
    """Candidate standard deviations of single pulses' fading [dB], of which the first is usual.
    With 1 dB for all, tags within 200 m with stronger fading were outside their regions."""
    more_fading_log: float = 10.0
    """Minimum log evidence for assuming a larger fading of single pulses than usual [nats]."""
    fading_cells: Guard[int] = 300
    """Number of the most likely ground cells over which sizes of fading are compared."""
    odd_fading_db: float = 6.0
    """Standard deviation of the levels of unusual pulses, such as those partly blocked by a
    body [dB]. Their share is that of pulses without information
    (`LevelPriors.outlier_share`)."""
    least_log: Guard[float] = -30.0
    loud_factor: float = 6.0
    """Factor f in f · ln E, which replaces the energy E of a slot with a strong pulse."""
    windows: tuple[float, float] = (0.8, 0.6)
    """Shares of a pulse's energy in its two best filter windows. With all energy in one window,
    a tag that the drone passed seemed farther away."""
    least_quiet: Guard[int] = 200
    """Minimum number of slots without pulses used to estimate the noise."""

    # A likely cell is divided in bearing and distance into this number of parts each: always
    # the likeliest cells, and at most this number of cells. For a strong tag the likelihood
    # varies more within such a wide cell than from cell to cell.
    parts: Resolution[int] = 3
    always_divided: Guard[int] = 60
    most_divided: Guard[int] = 300
    # Parts are divided again if their log likelihoods differ by more than this and they are
    # larger than this [m]; the drone's positions are not more accurate.
    even_log: Resolution[float] = 2.0
    finest_m: Resolution[float] = 3.0
    density_power: int = 8
    """Exponent of the probability density by which cells are weighted in the mean that is
    reported as position."""
    alone: float = 0.9
    """Minimum probability of a part of a region for its most likely point to become the
    position."""
    points: Resolution[int] = 7
    """Number of points along each side of a ground cell that spread its probability evenly."""
    kept: Resolution[float] = 0.998

    rate_change: float = 1e-3
    """Probability that a tag changes its pulse rate from one slot to the next."""
    stray_share: float = 1e-2
    """Share of slots that contain a pulse of another rate by chance: two slots of an
    interval."""
    log_slots: Guard[int] = 8
    """Number of slots whose inverse likelihood ratios are multiplied before taking a logarithm;
    each is up to e^30."""
    noise_share: float = 0.05
    """Share of time slots with noise alone whose energy is high enough to be taken for a
    pulse."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstTuning:
    """Constants for recognising a coded tag's bursts in a train."""

    stretches: Resolution[tuple[float, ...]] = (0.0, -0.67, 0.67)
    """Candidate stretches of a coded burst's gaps, as shares of the gaps' tolerance."""
    loud_pulses: Guard[int] = 2
    """Minimum number of strong pulses in a coded burst for the burst to count as strong."""
    most_energy: float = 40.0
    """Maximum contribution of one pulse to the recognition of a burst's code [noise
    energies]."""
    # Chance that equally strong pulses look more unequal, alone and with others near them.
    unequal_chance: float = 1e-3
    doubtful_chance: float = 0.1
    # Scatter of pulses in one burst, and over all, beyond noise, as shares of the mean.
    burst_scatter: float = 0.25
    mean_scatter: float = 0.1
    sender_sigmas: float = 4.5
    """Minimum sum of another sender's pulses [standard deviations of the sums]."""


ENERGY, SEARCH, PLACE, BURSTS = EnergyTuning(), SearchTuning(), PlaceTuning(), BurstTuning()
