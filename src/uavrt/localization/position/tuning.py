"""Constants of the position estimators and trackers, in one frozen record for each."""

from dataclasses import dataclass

from uavrt.localization.number_kinds import Fixed, Guard, Resolution


@dataclass(frozen=True, slots=True, kw_only=True)
class GridTuning:
    """Constants for the grids of cells that contain a position's posterior."""

    first_cells: Resolution[int] = 36
    """Number of position cells along the area's longer side at the start, before any is
    quartered."""
    held: Resolution[float] = 6e-4
    """Posterior probability of a position cell above which it is quartered."""
    held_rough: Resolution[float] = 2e-6
    """Probability above which an uneven position cell, which may hide a peak, is quartered."""
    rough_nats: Resolution[float] = 1.0
    """Difference of log-density between a cell's quarters above which the cell counts as uneven
    [nats]."""
    added_nats: Resolution[float] = 0.1
    """Change of a cell's log-likelihood by further data above which the cell may be uneven
    [nats]."""
    overlooked_nats: Resolution[float] = 7.0
    """Largest difference between the log-density at a wide cell's corner and the best one at
    which the cell may contain an unseen peak [nats]."""
    edge_share: Guard[float] = 0.005
    """Probability in the outermost cells above which the search area cuts off part of the
    posterior."""
    least_width_m: Guard[float] = 0.1
    """Width below which a position cell is not quartered [m]."""
    rounds: Guard[int] = 18
    """Maximum number of rounds in which likely position cells are quartered."""
    map_share: Resolution[float] = 0.999
    """Posterior probability that the extent of a position's map contains at least."""
    peak_cells: Resolution[int] = 44
    """Number of cells along a side of the regular grid that locates a posterior's maximum."""

    bearing_range_m: Guard[float] = 3000.0
    """Distance from the stations within which a tag is searched for by default [m]."""
    near_m: float = 100.0
    """Distance from the stations within which a position's prior is uniform [m]."""
    peak_heights: Resolution[float] = 0.25
    """Width of the likelihood peak in a survey by power, as a share of the height above the
    tag."""
    least_extent_share: Resolution[float] = 1.0 / 16.0
    """Minimum width of the cells that resolve the peak in a survey by power, as a share of the
    survey's extent."""

    negligible: Guard[float] = 0.005
    """Probability below which an explanation (rest, walk, compass error) is ignored."""
    map_cells: Resolution[int] = 100
    """Number of cells along the longer side of the probability map of a position."""
    survey_first_cells: Resolution[int] = 28
    """Number of cells along the longer side of a survey's grid before any is quartered."""
    survey_held: Resolution[float] = 2e-3
    """Probability above which a cell is quartered in a survey by power; a lower value changes
    no circle."""
    survey_growth: Resolution[float] = 2.0
    """Factor by which `held_rough` grows with each quartering in a survey by power. Without it,
    95 % circles are 0.3 % wider, with 50 % more cells."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingFixTuning:
    """Constants for positions from bearings: their error model, and Lenth's estimators."""

    step_deg: Resolution[float] = 0.25
    """Step between bearings in the tables of a bearing's probability [°]."""
    blurs_deg: Resolution[tuple[float, ...]] = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
    """Widths by which a bearing's density is blurred, to allow for the angle that a grid cell
    spans [°]."""
    unknown_sigmas_deg: tuple[float, ...] = (1.5, 3.0, 6.0, 12.0, 24.0)
    """Candidate standard deviations of a bearing for which none is known [°]. If they are 30 %
    larger, 95 % circles from bearings by hand are 6 % wider."""
    multiplied: Guard[int] = 16
    """Number of bearings' densities that are multiplied before taking a logarithm; the product
    of more could underflow."""
    evaluated_share: Resolution[float] = 0.9999
    """Probability contained in the cells over which heading error and outlier probabilities are
    averaged."""

    iterations: Guard[int] = 200
    """Maximum number of iterations of Lenth's estimators."""
    converged_m: Guard[float] = 0.001
    """Movement in one iteration of Lenth's estimators below which they have converged [m]."""
    andrews: Fixed[float] = 1.5
    """Tuning constant of Andrews' sine function, as in Lenth (1981) [standard deviations]."""
    diverged_m: Guard[float] = 100_000.0
    """Step of Lenth's estimators from which they count as diverged [m]; no radio tag is
    received so far away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonErrorTuning:
    """Constants for errors common to the bearings of a flight: wrong compass, walking animal,
    outliers.
    """

    heading_sigma_deg: float = 1.5
    """Default standard deviation of the error common to all headings of a flight [°]."""
    least_stations: Guard[int] = 4
    """Minimum number of bearings for estimating errors common to all of them."""
    widest_gap_deg: float = 210.0
    """Maximum arc without a station, seen from the tag, for estimating common errors [°]. If it
    is 30 % smaller, circles from stations on one side of the tag are half as wide when the
    compass is wrong."""
    wrong_compass_share: float = 0.02
    """Prior share of flights with a wrong compass."""
    wrong_compass_deg: float = 20.0
    """Standard deviation of the common heading error if the compass is wrong [°]."""
    walking_share: float = 0.05
    """Prior share of flights in which the animal walks between bearings."""
    walking_m_s: float = 0.5
    """Standard deviation of a walking animal's speed in each direction [m/s]."""
    least_span_s: Guard[float] = 20.0
    """Minimum time between the first and the last bearing for a walk of the animal to be
    recognised [s]."""
    contradiction: float = 0.01
    """Probability of the bearings' scatter by chance below which bearings contradict each
    other."""
    least_agreeing: Guard[int] = 3
    """Minimum number of agreeing bearings by which a position is confirmed despite an
    outlier."""
    rounds: Guard[int] = 25
    """Maximum number of iterations of a position's fit to bearings with outliers."""
    loose_rounds: Guard[int] = 8
    """Number of iterations at the start of the fit to bearings in which larger errors are
    tolerated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverTuning:
    """Constants for learning a person's errors from bearings to tags at known positions."""

    heading_sigma_deg: float = 5.0
    """Prior standard deviation of a person's mean bearing error [°]; the means of observed
    crews were -6° to +8°."""
    shares: Resolution[tuple[float, float, int]] = (0.02, 0.6, 14)
    """Trial shifts common to all bearings: smallest and largest [shares of the distance], and
    their number."""
    metres: Resolution[tuple[float, float, int]] = (5.0, 220.0, 15)
    """Trial shifts common to all bearings, independent of distance: smallest and largest [m],
    and their number."""
    outlier_share: float = 0.05
    """Prior share of a person's bearings in test trials that are unrelated to the tag."""
    reach: Guard[float] = 2.0
    """Largest examined shift common to a trial's bearings, as a share of the distance."""
    points: Resolution[int] = 41
    """Number of examined shifts common to a trial's bearings, in each of two directions."""
    scatters_deg: Resolution[tuple[float, float, int]] = (1.0, 30.0, 13)
    """Trial values of a person's bearing scatter: smallest and largest [°], and their
    number."""
    headings_deg: Resolution[tuple[float, float, int]] = (-20.0, 20.0, 33)
    """Trial mean errors of a person's bearings: smallest and largest [°], and their number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerTuning:
    """Constants for positions from the powers of a track's pulses, including missed pulses and
    hills.
    """

    reference_m: Fixed[float] = 100.0
    """Distance to which a tag's level refers [m]."""
    together: Guard[int] = 60_000
    """Number of values (positions × pulses) that are computed at once, so that they fit in the
    processor's cache."""
    most_correlation: Guard[float] = 0.93
    """Largest correlation of neighbouring pulses' fading that is examined."""
    widest_step: Resolution[float] = 0.3
    """Largest step between examined correlations of fading, in Fisher's transform."""

    missed_pulses: float = 50.0
    """Weight of the prior for the share of pulses missed by chance, as a number of pulses."""
    censored_rounds: Guard[int] = 8
    """Number of iterations in the fit of level and exponent if pulses were missed."""
    foreign_rounds: Guard[int] = 4
    """Number of iterations in the fit to received pulses of which some may come from other
    senders."""
    most_misses: Guard[int] = 60
    """Maximum number of missed pulses in a fit; of more, a part is used with greater weight."""
    lowest_sigmas: Resolution[float] = -12.0
    """Lower end of the tables of the normal distribution function [standard deviations]."""
    highest_sigmas: Resolution[float] = 8.0
    """Upper end of the tables of the normal distribution function [standard deviations]."""
    table_steps: Resolution[int] = 64
    """Number of table steps per standard deviation in the tables of the normal distribution
    function."""
    stretches: Resolution[tuple[int, ...]] = (8, 16, 32)
    """Lengths over which residuals of power are averaged to detect persistent errors
    [pulses]."""
    least_stretches: Guard[int] = 5
    """Minimum number of averaged stretches for detecting persistent errors."""
    most_lasting: Guard[float] = 0.98
    """Largest correlation of neighbouring pulses' errors that is derived from means over
    stretches."""

    hill_error: float = 0.2
    """Relative standard deviation of the computed loss behind hills, caused by a coarse map and
    trees."""
    same_error_m: float = 200.0
    """Length of the drone's path over which the error of losses behind hills is constant
    [m]."""

    in_a_row: Resolution[int] = 6
    """Number of consecutive pulses over which the SNR is averaged in a signal map."""
    layer_m: Resolution[float] = 10.0
    """Height range that one signal map covers [m]; a smaller range would contain too few
    pulses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyTuning:
    """Constants for height errors, pulses of other senders and mirror images in a survey by
    power.
    """

    height_sigma_m: float = 7.0
    """Default standard deviation of the error in a drone's stated height above the tag [m]."""
    height_share: float = 0.25
    """Maximum standard deviation assumed for the error of the height above the tag, as a share
    of that height. With a larger value, the loss behind an obstacle would be interpreted as a
    height error."""
    far_wrong_share: float = 0.1
    """Prior share of surveys whose stated height above the tag is grossly wrong."""
    far_wrong_sigmas: float = 4.0
    """Ratio of the standard deviation of gross height errors to that of usual ones. Without
    gross errors, a stated height of 80 m instead of 40 m causes no warning."""
    shifts_m: Resolution[tuple[float, ...]] = (-30.0, -18.0, -9.0, 0.0, 9.0, 18.0, 28.0, 40.0)
    """Candidate errors of the stated height above the tag [m]."""
    least_height_m: Guard[float] = 3.0
    """Minimum height above the tag after the correction of a stated height [m]."""
    closer_m: Resolution[tuple[float, ...]] = (-9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0)
    """Finer candidates for the height error, relative to the mean estimated with `shifts_m`
    [m]."""
    known_m: Resolution[float] = 6.0
    """Standard deviation of the height error below which it is refined with `closer_m` [m]."""
    nodes: Resolution[tuple[float, ...]] = (-1.5, 0.0, 1.5)
    """Heights over which a likelihood is averaged, relative to their mean [standard
    deviations]."""
    least_sigma_m: Guard[float] = 1.5
    """Minimum standard deviation of the height above the tag when it is averaged [m]."""
    least_bend: Guard[float] = 0.05
    """Minimum curvature that is assumed for the log-likelihood over the averaged heights
    [nats]."""

    most_readings: Guard[int] = 4
    """Maximum number of candidate sets of pulses from other senders that are compared."""
    readings_nats: Guard[float] = 6.0
    """Largest difference from the best log-probability at which a set of other senders' pulses
    is considered [nats]."""
    fading_shares: Resolution[tuple[float, ...]] = (0.0, 0.25, 0.5, 0.75, 1.0)
    """Candidate shares of a pulse's fading that neighbouring pulses have in common."""
    most_foreign: Guard[float] = 0.25
    """Largest share of pulses that may be excluded as other senders'; with more, no pulse is
    excluded."""
    least_pulses: Guard[int] = 20
    """Minimum number of pulses for estimating the height error and finding pulses of other
    senders."""
    received_share: Guard[float] = 0.95
    """Minimum share of pulses that must be received for height errors to be compared."""

    coarse_cells: Resolution[int] = 14
    """Number of cells along a side of the coarse grid of tag positions."""
    fine_cells: Resolution[int] = 9
    """Number of tag positions along a side of the grid on which height errors are compared."""
    rough_places: Resolution[int] = 2
    """Number of coarse position cells that are refined, since the most likely cell may be a
    mirror image."""
    rough_fine: Resolution[int] = 7
    """Number of cells along a side into which a coarse position cell is refined."""
    rough_pulses: Resolution[int] = 400
    """Number of pulses used on the coarse grid of tag positions."""
    margin_m: Guard[float] = 60.0
    """Margin of the coarse grid of tag positions around the track [m]."""
    mirror_reach: Resolution[float] = 1.75
    """Distance from the best position within which mirror images are searched for [coarse grid
    steps]."""
    mirror_cells: Resolution[int] = 15
    """Number of cells along a side of the grid in which mirror images are searched for."""
    mirror_nats: Guard[float] = 20.0
    """Largest difference from the best log-likelihood at which a mirror position is examined
    [nats]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Narrowing:
    """Grids around a likelihood peak that become finer from one to the next."""

    cells: int
    """Number of positions along each side of a grid."""
    velocities: int
    """Number of velocities in each direction of a grid."""
    rounds: int
    resolved_nats: float = 0.0
    """Steps of a grid are halved only if its peak's neighbours are lower by this [nats]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkTuning:
    """Constants for comparing a walking tag with a resting tag."""

    least_span_s: Guard[float] = 60.0
    """Minimum duration of a survey for a walk of the tag to be recognised [s]."""
    least_pulses: Guard[int] = 20
    """Minimum number of pulses for a walk of the tag to be recognised."""
    rough_pulses: Resolution[int] = 60
    """Number of pulses used in the coarse comparison of a walking tag with a resting tag."""
    rough_cells: Resolution[int] = 12
    """Number of position cells along a side of the coarse comparison of walk and rest."""
    speeds_m_s: Resolution[tuple[float, ...]] = (0.4, 0.9)
    """Candidate speeds of the tag in the coarse comparison of walk and rest [m/s]."""
    directions: Resolution[int] = 8
    """Number of directions of a tag's walk in the coarse comparison of walk and rest."""
    gate_nats: Guard[float] = 2.0
    """Evidence for a walk in the coarse comparison above which a fine one follows [nats]."""
    rough_step_m_s: Resolution[float] = 0.3
    """Distance between velocities in the coarse comparison of walk and rest [m/s]."""
    fine: Resolution[Narrowing] = Narrowing(cells=9, velocities=5, rounds=3)
    """Grids in the fine comparison of walk and rest in a survey."""
    flight: Resolution[Narrowing] = Narrowing(
        cells=5, velocities=3, rounds=7, resolved_nats=1.5
    )
    """Grids in the comparison of walk and rest by the energies of a whole flight."""
    least_part: Guard[float] = 0.1
    """Least probability of a velocity that is examined further, relative to the largest."""
    most_radius_m: Guard[float] = 1000.0
    """Largest 95 % radius of a tag after a whole flight for which a walk is checked [m]."""
    survey_margin: Guard[float] = 0.25
    """Margin around a survey within which a walking tag is searched for, as a share of the
    survey's extent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelTuning:
    """Constants for a tag's strength at each position, and for its update by received and
    missed pulses.
    """

    false_pulse_db: float = 3.0
    """Mean level of false pulses above the threshold [dB]; the levels are exponentially
    distributed."""
    least_share: Guard[float] = 1e-30
    """Minimum probability of a pulse or a miss by chance, which keeps logarithms finite."""
    least_growth: Guard[float] = 0.1
    """Smallest ratio of an exponent's precision after and before information is withdrawn."""
    least_variance: Guard[float] = 1e-6
    """Smallest variance of an exponent that is drawn; rounding errors are smaller."""
    pattern_steps: Resolution[int] = 4096
    """Number of steps of a pattern's table over the cosine of the angle off boresight."""
    tail_step: Resolution[float] = 0.005
    """Step of the table of the normal distribution's tail [standard deviations]."""
    tail_sigmas: Guard[float] = 12.0
    """Range of the table of the normal distribution's tail on both sides [standard
    deviations]."""
    receiver_gains_db: tuple[tuple[float, float], ...] = ((0.7, 6.0), (0.3, 20.0))
    """Error common to all levels of another receiver: probability and standard deviation [dB]
    of two cases.

    Another radio or cable changes levels by some decibels. Because the ground reflects, the
    level of a distant tag is 20 dB lower at an antenna 6 m high than at 60 m; a hut weakens it
    further. If the standard deviations are 30 % larger, circles from one turn and three masts
    are 6 % wider."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LastingError:
    """Parameters of a slowly varying error of expected levels, which is estimated from pulses.

    Its correlation falls exponentially with the length of the drone's path. It is a multiple of
    the loss behind hills, or of the standard deviation of shadowing.
    """

    mean: float
    sigma: float
    """Standard deviation of the lasting error of levels before any pulse."""
    correlation_m: float
    """Length of the drone's path over which the error's correlation falls to 1 / e [m]."""
    limits: Guard[tuple[float, float]]
    """Minimum and maximum mean of the lasting error of levels after pulses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LossErrorTuning:
    """Constants for lasting errors of levels, caused by inaccurate losses behind hills and by
    shadowing.
    """

    hills: LastingError = LastingError(
        mean=0.4, sigma=0.5, correlation_m=800.0, limits=(-0.7, 2.5)
    )
    """Error of losses behind hills, relative to the losses computed from the map; rounded
    hilltops cause up to twice the loss (P.526-15, 4.2), woods even more."""
    shadowing: LastingError = LastingError(
        mean=0.0, sigma=1.0, correlation_m=30.0, limits=(-4.0, 4.0)
    )
    """Shadowing in units of its standard deviation. Its correlation falls exponentially along
    the path (Gudmundson 1991, "Correlation model for shadow fading in mobile radio systems").
    With a correlation length of 100 m, a search of 15 minutes does not locate a walking animal
    within 25 m; with 30 m it takes 5 minutes."""
    grazing_db: float = 6.0
    """Change of a loss by some metres of height if the path just grazes the hill [dB]. Without
    it, 95 % circles among hills are 13 % smaller."""
    grazing_fall_db: float = 3.0
    """Loss behind a hill at which `grazing_db` has fallen to 1 / e of its value [dB]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReflectionTuning:
    """Constants of an unknown reflection by level ground."""

    permittivity: Fixed[complex] = 15.0 - 0.6j
    """Complex relative permittivity of medium ground at 150 MHz (5 mS/m)."""
    heights: Resolution[tuple[float, float, int]] = (0.025, 1.0, 40)
    """Smallest, largest and number of equally probable heights of a tag [wavelengths]."""
    shares: Resolution[tuple[float, ...]] = (0.2, 0.4, 0.6, 0.8, 1.0)
    """Shares of the reflected amplitude that remain on rough ground, equally probable."""
    components: Resolution[int] = 2
    """Number of principal components of the reflection; a third has 14 % of the variance."""
    least_sine: Guard[float] = 0.05
    """Smallest sine of an elevation at which reflections are averaged: 800 m away, 40 m up."""
    least_sum: Guard[float] = 0.03
    """Smallest sum of direct and reflected ray, as a share of the direct ray."""
    steps: Resolution[int] = 257
    """Number of elevations in the table of reflections."""
    rounds: Resolution[int] = 60
    """Number of power iterations that determine each principal component of the reflection."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackTuning:
    """Constants for the particle tracker of a tag, and for paths of moving tags."""

    settled_m: Guard[float] = 0.02
    """Movement of the best point in one iteration below which it has converged [m]."""
    strays_sigmas: float = 2.0
    """Largest distance of an animal outside its area [standard deviations of its walk]."""
    unheard_nats: float = 0.7
    """Largest change of the log-likelihood ratio of clutter to tag by one unexplained missed
    pulse [nats]."""
    decay_nats: float = 0.1
    """Decrease of the log-likelihood ratio of clutter to tag with each expected pulse
    [nats]."""
    switching_per_s: float = 0.005
    """Rate at which an animal changes between rest, browsing and travel [1/s]."""
    lost_nats: float = 12.0
    """Log-likelihood ratio of clutter to tag above which all position hypotheses are redrawn
    [nats]."""
    paths: Guard[int] = 4000
    """Number of position hypotheses whose paths are traced back to give a tag's path."""

    least_times: Guard[int] = 3
    """Minimum number of bearings or pulses for the path of a moving tag."""
    particles: Guard[int] = 40_000
    """Number of position hypotheses (particles) for a moving tag's path. With 10 000, too few
    of them follow an animal that alternately stops and moves."""
    first_particles: Guard[int] = 80_000
    """Number of position hypotheses at the beginning of a moving tag's path."""
    point_step_s: Resolution[float] = 15.0
    """Minimum time between two points of a tag's path that are not at a bearing [s]."""
    most_points: Guard[int] = 40
    """Maximum number of points of a tag's path that are not at a bearing."""
    fastest_m_s: Guard[float] = 2.0
    """Largest mean speed of an animal away from the position found for the whole flight
    [m/s]."""
    margin_m: Guard[float] = 300.0
    """Margin around the area in which a moving tag's path is searched for by bearings [m]."""
    end_m: float = 120.0
    """Constant part of the uncertainty of a tag's first and last position in a survey [m]."""
    end_m_s: float = 0.15
    """Growth of the uncertainty of a walking tag's first and last position with a survey's
    duration [m/s]."""
    fading_factor: float = 1.1
    """Factor on the standard deviation of fading for the path of a moving tag, because a
    survey's likelihood is too narrow for the number of hypotheses. Without the factor, and with
    10 000 hypotheses, the 95 % circles contained 85 % of the tags that walk at 1 m/s."""
    turning_m_s_per_root_s: float = 0.03
    """Random change of a tag's velocity per axis after a second [m/s/√s]: 20° at 1 m/s in two
    minutes. The 95 % circles contain 97 % of the tags that walk straight, and 93 % of those
    that turn by 0.05 m/s/√s."""


GRID, BEARING_FIX, COMMON = GridTuning(), BearingFixTuning(), CommonErrorTuning()
POWER, SURVEY, WALK = PowerTuning(), SurveyTuning(), WalkTuning()
LEVEL, LOSS, TRACK = LevelTuning(), LossErrorTuning(), TrackTuning()
REFLECTION = ReflectionTuning()
OBSERVER = ObserverTuning()
