"""Constants of the bearing estimators, in one frozen record for each estimator."""

from dataclasses import dataclass

from uavrt.localization.number_kinds import Guard, Resolution


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnTuning:
    """Constants for recognising turns in place in the poses of a flight."""

    window_s: float = 2.5
    """Window over which speed, climb and rate of turn are averaged, and minimum duration of a
    stop [s]. GNSS noise averages out, and 0.5° of compass error gives 0.2°/s. If it is 30 %
    larger, 6 % fewer stops are counted."""
    speed_m_s: float = 1.5
    """Speed up to which a drone counts as hovering in wind [m/s]."""
    path_window_s: float = 15.0
    """Time before and after a pose over which its displacement is measured [s]."""
    window_shift_m: float = 3.0
    """Minimum displacement within `path_window_s`, both before and after a pose, for the pose
    to count as part of a flown path between turns [m]. If it is 30 % larger, 4 % fewer turns
    are separated from the next one."""
    radius_m: float = 15.0
    """Maximum distance of the drone from the middle of a turn in place [m]. If it is 30 %
    smaller, 23 % of the turns that drift are not found."""
    drift_span_deg: float = 45.0
    """Shorter of two spans of yaw over which a turn's drift is measured [°]; the longer one is
    twice as long."""
    drift_step_deg: Resolution[float] = 5.0
    """Step in yaw between the starts of the spans over which a turn's drift is measured [°]."""
    one_turn_deg: float = 450.0
    """Maximum yaw of a single turn [°]; more may be two turns with a flown path between. If it
    is 30 % smaller, 4 % of the turns that drift are split."""
    reversal_deg: float = 25.0
    """Smallest rotation that is not caused by hovering or overshoot [°]. A rotation against a
    turn's direction ends the turn; a directional antenna that rotates less has not turned."""
    stop_deg: float = 4.0
    """Maximum change of heading for a drone that turns in steps to count as stopped [°]. If it
    is 30 % smaller, 19 % more stops are counted."""
    longest_pause_s: Guard[float] = 180.0
    """Longest stop within one turn [s]; a longer one separates two turns."""
    least_rate_deg_s: float = 0.5
    """Minimum rate of a turn [°/s]; a slower change of heading is drift. If it is 30 % larger,
    5 % fewer stops are counted."""
    height_error_m: float = 4.0
    """Largest error of a height by gusts or a drifting barometer [m]. A drone that is not
    higher counts as on the ground; a smaller change within `path_window_s` is no climb."""
    around_start_m: Guard[float] = 100.0
    """Distance from take-off and landing beyond which low poses count as flight [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PatternTuning:
    """Constants for the posterior of a bearing from pulse powers and the antenna's pattern."""

    grid_step_deg: Resolution[float] = 0.25
    """Step between two bearings in a bearing's final posterior [°]."""
    coarse_step_deg: Resolution[float] = 3.0
    """Step between two trial bearings of the coarse search, which precedes the fine search
    [°]."""
    coarse_level_steps: Resolution[int] = 6
    """Step between two trial levels of the coarse bearing search [0.25 dB steps]: 1.5 dB."""
    levels_each_side: Resolution[int] = 10
    """Number of fine levels tried on each side of a trial bearing's best coarse level."""
    lowest_level_db: Guard[float] = -6.0
    """Lowest SNR on boresight, in a turn's fit, of a detectable tag [dB]."""
    refined_nats: Guard[float] = 18.0
    """Difference from the best log-density above which a trial bearing is not refined
    [nats]."""
    lobe_deg: float = 25.0
    """Half-width of a lobe of a bearing's posterior [°]. If it is 30 % smaller, bearings from 8
    pulses have 12 % smaller standard deviations, and half of them count as ambiguous."""
    correlation_pulses: Guard[int] = 12
    """Minimum number of pulses for estimating the correlation of neighbouring pulses'
    fading."""
    # Fading that is correlated from pulse to pulse.
    correlations: Resolution[tuple[float, ...]] = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95)
    """Candidate correlations of neighbouring pulses' fading."""
    variance_factors: tuple[float, ...] = (1.0, 2.0, 4.0)
    """Candidate ratios of the fading variance to that estimated for independent pulses. Ratios
    above 1 are tried because fading that is correlated over more than a quarter turn resembles
    the antenna's pattern. If the ratios are 30 % larger, credible arcs of bearings in
    correlated fading are 6 % wider."""
    correlated_share: float = 0.2
    """Prior share of turns in which neighbouring pulses' fading is correlated. If it is 30 %
    larger, credible arcs of bearings are 2 % wider."""
    most_pulses: Guard[int] = 240
    """Maximum number of pulses for which correlated fading is evaluated, which limits the
    computing time."""
    least_pulses: Guard[int] = 12
    """Number of pulses from which correlated fading increases a bearing's stated error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoPathTuning:
    """Constants for detecting a second propagation path, such as a reflection, in a turn."""

    apart_deg: Resolution[tuple[int, ...]] = (20, 35, 50, 65, 80, 100, 120, 150, 180)
    """Candidate angles between a tag's two propagation paths, one a reflection [°]."""
    weaker_db: Resolution[tuple[float, ...]] = (-6.0, -3.0, -1.0, 0.0)
    """Candidate levels of the weaker propagation path relative to the stronger [dB]."""
    cosines: Resolution[tuple[float, ...]] = (-0.95, -0.6, 0.0, 0.6, 0.95)
    """Candidate cosines of the phase between the signals on two propagation paths."""
    least_pulses: Guard[int] = 12
    """Minimum number of pulses in a turn for a search for two propagation paths."""
    least_gain_nats: float = 8.0
    """Minimum log-likelihood ratio of two paths to one path [nats]; noise exceeds it in 1 % of
    turns (B6). If it is 30 % smaller, 19 % of turns in correlated fading are flagged instead
    of 8 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedPatternTuning:
    """Constants for learning an antenna's pattern from a flight's turns."""

    harmonics: int = 6
    """Number of cosine harmonics in the correction of an antenna pattern."""
    rounds: Guard[int] = 3
    """Number of times that bearings are estimated and the pattern is then corrected."""
    prior_db: float = 1.5
    """Prior error of a maker's plot of an antenna pattern, rms over all angles [dB]."""
    angles: Resolution[int] = 37
    """Number of angles from 0° to 180° in a learned antenna pattern: steps of 5°."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimpleBearingTuning:
    """Constants for bearings by correlation, by several antennas, and by switched antennas."""

    scan_step_deg: Resolution[float] = 0.5
    """Step between two trial bearings when correlating powers with the pattern [°]."""
    array_fading_db: float = 2.0
    """Rms level difference between adjacent antennas that is not caused by the direction
    [dB]."""
    carrier_step_hz: Resolution[float] = 0.5
    """Step of the carrier search within a switched pulse [Hz]; over 20 ms it rotates the phase
    by 0.01 cycles."""


TURNS, PATTERN, TWO_PATHS = TurnTuning(), PatternTuning(), TwoPathTuning()
LEARNED_PATTERN, SIMPLE = LearnedPatternTuning(), SimpleBearingTuning()
