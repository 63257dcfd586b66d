"""Constants of the position estimators and trackers, one frozen record for each."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class GridTuning:
    """Constants for the grids of cells that hold a position's posterior."""

    first_cells: int = 36
    """Number of position cells along the area's longer side before any is quartered."""
    held: float = 6e-4
    """Posterior probability of a position cell above which it is quartered."""
    held_rough: float = 2e-6
    """Probability above which an uneven position cell, which may hide a peak, is quartered."""
    rough_nats: float = 1.0
    """Difference of log-density between a cell's quarters above which it is uneven [nats]."""
    added_nats: float = 0.1
    """Change of a cell's log-likelihood by further data above which it may be uneven [nats]."""
    overlooked_nats: float = 7.0
    """Log-density below the best within which a wide cell's corner may be a peak [nats]."""
    edge_share: float = 0.005
    """Probability of the outermost cells above which the area cuts the position's posterior."""
    least_width_m: float = 0.1
    """Width below which a position cell is not quartered [m]."""
    rounds: int = 18
    """Maximum number of rounds in which likely position cells are quartered."""
    map_share: float = 0.999
    """Minimum posterior probability within the extent of a position's map."""
    peak_cells: int = 44
    """Number of cells along a side of the regular grid that locates a posterior's maximum."""

    bearing_range_m: float = 3000.0
    """Default distance from the bearings' stations within which a tag is searched [m]."""
    near_m: float = 100.0
    """Distance from the stations within which a position's prior is uniform [m]."""
    peak_heights: float = 0.25
    """Width of a power survey's likelihood peak, as a share of the height above the tag."""
    least_extent_share: float = 1.0 / 16.0
    """Minimum width of cells that resolve a power survey's peak, as a share of its extent."""

    negligible: float = 0.005
    """Probability below which an explanation (rest, walk, compass error) is ignored."""
    map_cells: int = 100
    """Number of cells along the longer side of the probability map of a position."""
    map_sigmas: float = 8.0
    """Extent of a cell's normal distribution in a position's map [standard deviations]."""
    map_reach: int = 10
    """Reach of a cell's normal density above which a map is computed by rows [map cells]."""
    survey_first_cells: int = 28
    """Number of cells along the longer side of a survey's grid before any is quartered."""
    survey_held: float = 2e-3
    """Probability at which a power survey's cells are quartered; less changes no circle."""
    survey_growth: float = 2.0
    """Growth of `held_rough` with each quartering of position cells, for power surveys. Without
    it, 95 % circles are 0.3 % wider, at half as many cells again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingFixTuning:
    """Constants for positions from bearings: their error model, and Lenth's estimators."""

    step_deg: float = 0.25
    """Step in bearing of the tables of a bearing's probability [°]."""
    blurs_deg: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
    """Widths by which a bearing's density is blurred, for the angle a grid cell spans [°]."""
    unknown_sigmas_deg: tuple[float, ...] = (1.5, 3.0, 6.0, 12.0, 24.0)
    """Candidate standard deviations of a bearing whose own is unknown [°]."""
    multiplied: int = 16
    """Number of bearings' densities multiplied before a logarithm; more could underflow."""
    evaluated_share: float = 0.9999
    """Probability held by the cells over which heading error and outliers are averaged."""

    iterations: int = 200
    """Maximum number of iterations of Lenth's estimators."""
    converged_m: float = 0.001
    """Movement in one iteration of Lenth's estimators below which they have converged [m]."""
    andrews: float = 1.5
    """Tuning constant of the sine function by Andrews in Lenth (1981) [standard deviations]."""
    diverged_m: float = 100_000.0
    """Step of Lenth's estimators that means divergence [m]: beyond any radio tag's range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonErrorTuning:
    """Constants for errors that bearings of a flight share: compass, walk, outliers."""

    heading_sigma_deg: float = 1.5
    """Default standard deviation of the error that all headings of a flight share [°]."""
    least_stations: int = 4
    """Minimum number of bearings from which errors common to all are estimated."""
    widest_gap_deg: float = 210.0
    """Maximum arc without a station, seen from the tag, to estimate common errors [°]."""
    wrong_compass_share: float = 0.02
    """Prior share of flights with a wrong compass."""
    wrong_compass_deg: float = 20.0
    """Standard deviation of the common heading error with a wrong compass [°]."""
    walking_share: float = 0.05
    """Prior share of flights in which the animal walks between bearings."""
    walking_m_s: float = 0.5
    """Standard deviation of a walking animal's speed in each direction [m/s]."""
    least_span_s: float = 20.0
    """Minimum time between first and last bearing that can show that an animal walks [s]."""
    contradiction: float = 0.01
    """Chance probability of the scatter below which bearings contradict each other."""
    good_outlier: float = 0.1
    """Probability of being an outlier below which a bearing always counts as good."""
    least_agreeing: int = 3
    """Minimum number of agreeing bearings that confirm a position against an outlier."""
    rounds: int = 25
    """Maximum number of iterations of a position's fit to bearings with outliers."""
    loose_rounds: int = 8
    """Number of first iterations of the fit to bearings that tolerate larger errors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverTuning:
    """Constants for learning a person's errors from bearings to known places."""

    heading_sigma_deg: float = 5.0
    """Prior standard deviation of a person's mean bearing error [°]; crews had -6° to +8°."""
    shares: tuple[float, float, int] = (0.02, 0.6, 14)
    """Smallest and largest trial shift common to bearings [share of distance]; their number."""
    metres: tuple[float, float, int] = (5.0, 220.0, 15)
    """Smallest and largest trial shift common to bearings at any distance [m]; their number."""
    outlier_share: float = 0.05
    """Prior share of a person's bearings in test trials that are unrelated to the tag."""
    reach: float = 2.0
    """Largest shift common to bearings that is examined, as a share of the distance."""
    points: int = 41
    """Number of shifts common to bearings examined in each of two directions."""
    scatters_deg: tuple[float, float, int] = (1.0, 30.0, 13)
    """Smallest and largest trial scatter of a person's bearings [°]; number of trials."""
    headings_deg: tuple[float, float, int] = (-20.0, 20.0, 33)
    """Least, largest and number of trial mean errors of a person's bearings [°]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerTuning:
    """Constants for positions from the powers of a track's pulses, with misses and hills."""

    least_extent_m: float = 20.0
    """Minimum extent of a flight with pulse powers [m]; less is one place with GNSS noise."""
    reference_m: float = 100.0
    """Distance to which a tag's level refers [m]."""
    typical_fading_db: float = 4.0
    """Prior standard deviation of fading from pulse to pulse [dB]."""
    together: int = 60_000
    """Number of values (positions × pulses) computed at once, so that they fit in the cache."""
    most_correlation: float = 0.93
    """Largest correlation of neighbouring pulses' fading that is examined."""
    widest_step: float = 0.3
    """Largest step between examined correlations of fading, in Fisher's transform."""

    missed_share: float = 0.02
    """Prior share of strong pulses that the detector misses by chance."""
    missed_pulses: float = 50.0
    """Weight of the prior of the share of pulses missed by chance, as a number of pulses."""
    censored_rounds: int = 8
    """Number of iterations of the fit of level and exponent with missed pulses."""
    most_misses: int = 60
    """Maximum number of missed pulses in a fit; more are thinned out and weighted."""
    log_root_two_pi: float = 0.918_938_533_2
    lowest_sigmas: float = -12.0
    """Lower end of the tables of the normal distribution function [standard deviations]."""
    highest_sigmas: float = 8.0
    """Upper end of the tables of the normal distribution function [standard deviations]."""
    table_steps: int = 64
    """Steps per standard deviation of the tables of the normal distribution function."""
    stretches: tuple[int, ...] = (8, 16, 32)
    """Lengths over which power residuals are averaged to find persistent errors [pulses]."""
    least_stretches: int = 5
    """Minimum number of averaged stretches of pulses that can show persistent errors."""
    most_lasting: float = 0.98
    """Largest correlation of neighbouring pulses' errors inferred from stretch means."""

    hill_error: float = 0.25
    """Relative standard deviation of the loss computed behind hills (coarse map, trees)."""
    hill_factors: tuple[tuple[float, float], ...] = (
        (0.65, 1.0 / 6.0),
        (1.0, 2.0 / 3.0),
        (1.35, 1.0 / 6.0),
    )
    """Candidate factors on all hill losses and their probabilities, by Gauss-Hermite."""
    hidden_db: float = 0.5
    """Loss above which a pulse counts as hidden behind a hill [dB]."""
    map_error_db: float = 2.0
    """Change of a hidden pulse's loss behind a hill by some metres of map error [dB]."""
    same_error_m: float = 200.0
    """Length of the drone's path over which the error of hill losses is constant [m]."""

    in_a_row: int = 6
    """Number of consecutive pulses over which the SNR in a signal map is averaged."""
    layer_m: float = 10.0
    """Height range of one layer of a signal map [m]; thinner ones have too few pulses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyTuning:
    """Constants for height errors, foreign pulses and mirror images in a survey's powers."""

    height_sigma_m: float = 7.0
    """Default standard deviation of the stated height of a drone above the tag [m]."""
    height_share: float = 0.25
    """Maximum standard deviation assumed for an error of the height above the tag, as a share
    of that height. With a larger one, an obstacle's loss is taken for a height error."""
    far_wrong_share: float = 0.1
    """Prior share of surveys whose stated height above the tag is grossly wrong."""
    far_wrong_sigmas: float = 4.0
    """Ratio of the standard deviation of gross height errors to that of usual ones."""
    shifts_m: tuple[float, ...] = (-30.0, -18.0, -9.0, 0.0, 9.0, 18.0, 28.0, 40.0)
    """Candidate errors of the stated height above the tag [m]."""
    least_height_m: float = 3.0
    """Minimum height above the tag after the correction of a stated height [m]."""
    closer_m: tuple[float, ...] = (-9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0)
    """Finer candidates for the height error, relative to the mean by `shifts_m` [m]."""
    known_m: float = 6.0
    """Standard deviation of the height error below which `closer_m` refine it [m]."""
    nodes: tuple[float, ...] = (-1.5, 0.0, 1.5)
    """Heights over which a likelihood is averaged, from their mean [standard deviations]."""
    least_sigma_m: float = 1.5
    """Minimum standard deviation of the height above the tag when it is averaged [m]."""
    least_bend: float = 0.05
    """Minimum curvature of the log-likelihood over the averaged heights [nats]."""

    foreign_share: float = 0.02
    """Prior share of a survey's pulses that another sender transmitted."""
    foreign_range_db: float = 60.0
    """Range of powers over which other senders' pulses are uniformly distributed [dB]."""
    most_readings: int = 4
    """Maximum number of candidate sets of other senders' pulses that are compared."""
    readings_nats: float = 6.0
    """Log-probability below the best set of foreign pulses within which a set counts [nats]."""
    fading_shares: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75, 1.0)
    """Candidate shares of a pulse's fading that neighbouring pulses have in common."""
    most_foreign: float = 0.25
    """Maximum share of other senders' pulses; with more, no pulse is excluded."""
    least_pulses: int = 20
    """Minimum number of pulses to estimate the height error and find other senders' pulses."""
    received_share: float = 0.95
    """Minimum share of received pulses for height errors to be compared."""

    coarse_cells: int = 14
    """Number of cells along a side of the coarse grid of tag positions."""
    fine_cells: int = 9
    """Number of tag positions along a side of the grid on which height errors are compared."""
    rough_places: int = 2
    """Number of coarse position cells that are refined; the likeliest may be a mirror image."""
    rough_fine: int = 7
    """Number of cells along a side of a refined coarse position cell."""
    rough_pulses: int = 400
    """Number of pulses used on the coarse grid of tag positions."""
    margin_m: float = 60.0
    """Margin of the coarse grid of tag positions around the track [m]."""
    mirror_reach: float = 1.75
    """Distance from the best position searched for mirror images [coarse grid steps]."""
    mirror_cells: int = 15
    """Number of cells along a side of the position grid searched for mirror images."""
    mirror_nats: float = 20.0
    """Log-likelihood below the best within which a mirror position is examined [nats]."""
    least_db: float = 0.05
    """Minimum residual scatter of pulse powers in the robust fit [dB]: their resolution."""
    freedom: float = 3.0
    """Degrees of freedom of Student's t for powers in the robust fit."""
    rounds: int = 4
    """Number of iterations of the robust fit to powers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkTuning:
    """Constants for comparing a walking with a resting tag in the powers of a survey."""

    least_span_s: float = 60.0
    """Minimum duration of a survey that can show that the tag walked [s]."""
    least_pulses: int = 20
    """Minimum number of pulses that can show that the tag walked."""
    rough_pulses: int = 60
    """Number of pulses in the coarse comparison of a walking with a resting tag."""
    rough_cells: int = 12
    """Number of position cells along a side of the coarse comparison of walk and rest."""
    speeds_m_s: tuple[float, ...] = (0.4, 0.9)
    """Candidate speeds of the tag in the coarse comparison of walk and rest [m/s]."""
    directions: int = 8
    """Number of directions of a tag's walk in the coarse comparison of walk and rest."""
    gate_nats: float = 2.0
    """Evidence for a walk in the coarse comparison above which a fine one follows [nats]."""
    fine_cells: int = 9
    """Number of position cells along a side of the fine comparison of walk and rest."""
    fine_velocities: int = 5
    """Number of tag velocities in each direction in the fine comparison of walk and rest."""
    rounds: int = 3
    """Number of times that the fine comparison of walk and rest halves its steps."""
    resting_fading_db: float = 6.0
    """Fading assumed when tracking the path of a tag that rests in the survey [dB]."""
    survey_margin: float = 0.25
    """Margin around a survey that is searched for a walking tag, as a share of its extent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelTuning:
    """Constants for a tag's strength at each position, and its update by pulses and misses."""

    by_chance: float = 0.02
    """Share of pulses missed, or received at any strength, independent of the geometry."""
    any_strength_per_db: float = 1.0 / 120.0
    """Probability density of a pulse's power if all strengths are equally probable [1/dB]."""
    false_pulse_db: float = 3.0
    """Mean power of false pulses above the threshold [dB], exponentially distributed."""
    root_two_pi: float = 2.506_628_275
    least_share: float = 1e-30
    """Minimum probability of a pulse or a miss by chance, which keeps logarithms finite."""
    pattern_steps: int = 4096
    """Number of steps of a pattern's table, over the cosine of the angle off boresight."""
    tail_step: float = 0.005
    """Step of the table of the normal distribution's tail [standard deviations]."""
    tail_sigmas: float = 12.0
    """Range of the table of the normal tail to both sides [standard deviations]."""
    receiver_gains_db: tuple[tuple[float, float], ...] = ((0.7, 6.0), (0.3, 20.0))
    """Common error of another receiver's levels: probability and standard deviation [dB] of two
    cases. Another radio or cable makes some decibels. By the ground's reflection, an antenna
    at 6 m receives a far tag 20 dB weaker than one at 60 m; a hut weakens it further."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LastingError:
    """An error of expected levels that pulses reveal, and that changes along the path."""

    mean: float
    sigma: float
    """Standard deviation of the lasting error of levels before any pulse."""
    correlation_m: float
    """Path length of the drone over which the error's correlation falls to 1 / e [m]."""
    limits: tuple[float, float]
    """Minimum and maximum mean of the lasting error of levels after pulses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LossErrorTuning:
    """Constants for lasting errors of levels: of losses behind hills, and by shadowing."""

    hills: LastingError = LastingError(
        mean=0.4, sigma=0.5, correlation_m=800.0, limits=(-0.7, 2.5)
    )
    """Error of losses behind hills, relative to those by the map; round tops lose up to twice
    as much (P.526-15, 4.2), woods more."""
    shadowing: LastingError = LastingError(
        mean=0.0, sigma=1.0, correlation_m=100.0, limits=(-4.0, 4.0)
    )
    """Shadowing in units of its standard deviation. Its correlation is exponential in the path,
    and falls to 1 / e over 8 m in towns and 500 m in suburbs (Gudmundson 1991, "Correlation
    model for shadow fading in mobile radio systems"). The phase of the ray that level ground
    reflects changes by 1 rad over 40 to 160 m (drone at 40 m, tag at 1 m, distance 100 to
    200 m)."""
    pulse_share: float = 0.05
    """Standard deviation of errors that differ between pulses, as a share of a hill's loss."""
    grazing_db: float = 6.0
    """Change of a hill's loss by some metres of height where the path grazes it [dB]."""
    grazing_fall_db: float = 3.0
    """Loss behind a hill at which `grazing_db` has fallen to 1 / e of its value [dB]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackTuning:
    """Constants for the particle tracker of a tag, and for paths of moving tags."""

    settled_m: float = 0.02
    """Movement of a track's best point in one iteration below which it has converged [m]."""
    strays_sigmas: float = 2.0
    """Maximum distance of an animal outside its area [standard deviations of its walk]."""
    unheard_nats: float = 0.7
    """Maximum effect of one unexplained miss on the log ratio of clutter to tag [nats]."""
    decay_nats: float = 0.1
    """Decay of the log ratio of clutter to tag with each expected pulse [nats]."""
    switching_per_s: float = 0.005
    """Rate at which an animal changes between rest, browsing and travel [1/s]."""
    lost_nats: float = 12.0
    """Log-likelihood ratio of clutter to tag above which position hypotheses are redrawn."""
    paths: int = 4000
    """Number of position hypotheses whose paths are smoothed after the flight."""

    least_times: int = 3
    """Minimum number of bearings or pulses for a moving tag's path."""
    particles: int = 10_000
    """Number of position hypotheses (particles) for a moving tag's path."""
    first_particles: int = 80_000
    """Number of position hypotheses at the beginning of a moving tag's path."""
    point_step_s: float = 15.0
    """Minimum time between two points of a tag's path that are not at a bearing [s]."""
    most_points: int = 40
    """Maximum number of points of a tag's path that are not at a bearing."""
    fastest_m_s: float = 2.0
    """Maximum mean speed of an animal away from the position found for a flight [m/s]."""
    margin_m: float = 300.0
    """Margin around the area searched for a moving tag's path by bearings [m]."""
    end_m: float = 120.0
    """Constant part of the uncertainty of a tag's first and last position in a survey [m]."""
    end_m_s: float = 0.15
    """Growth of a walking tag's uncertainty at both ends with a survey's duration [m/s]."""
    fading_factor: float = 1.1
    """Factor on a pulse's fading, because ten thousand hypotheses are too few for a survey's
    sharp likelihood. Without it, circles held 85 % of the tags walking at 1 m/s."""
    turning_m_s_per_root_s: float = 0.03
    """Change of a tag's velocity per axis after a second [m/s/√s]: 20° at 1 m/s in two minutes.
    Circles hold 97 % of straight walkers, 93 % of those turning by 0.05 m/s/√s."""


GRID, BEARING_FIX, COMMON = GridTuning(), BearingFixTuning(), CommonErrorTuning()
POWER, SURVEY, WALK = PowerTuning(), SurveyTuning(), WalkTuning()
LEVEL, LOSS, TRACK = LevelTuning(), LossErrorTuning(), TrackTuning()
OBSERVER = ObserverTuning()
