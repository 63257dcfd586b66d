"""Constants of localization that bearings and positions have in common, in one frozen record
for each use.

The records of single estimators are in `bearing.tuning` and `position.tuning`.
"""

from dataclasses import dataclass

from uavrt.localization.number_kinds import Guard, Resolution


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerLawTuning:
    """Constants for the tables of the probability of a pulse's power, given its expected
    level.
    """

    level_step_db: Resolution[float] = 0.25
    """Step between two expected pulse levels in the likelihood tables [dB]."""
    lowest_level_db: Guard[float] = -30.0
    """Lowest tabulated level of a pulse over noise [dB]; a weaker pulse adds only 0.1 % to the
    power."""
    fadings_db: Resolution[tuple[float, ...]] = (0.5, 0.9, 1.5, 2.5, 4.0, 6.5)
    """Candidate standard deviations of fading from pulse to pulse [dB]."""
    gaussian_from: Guard[float] = 1000.0
    """Power over noise from which the power in decibels is normally distributed to within 1 %:
    30 dB."""
    least_density: Guard[float] = 1e-300
    """Lower limit of a pulse's probability density, so that its logarithm is finite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelPriors:
    """Prior knowledge of received levels, used by all estimators and trackers."""

    exponent: float = 2.5
    """Mean path loss exponent: 2 in free space, 4 beyond the break point over ground."""
    exponent_sigma: float = 0.7
    """Standard deviation of the path loss exponent."""
    shadowing_db: float = 3.0
    """Standard deviation [dB] of shadowing, which is the loss by ground and plants at a
    position, and of a tag's level between flights."""
    fading_db: float = 4.0
    """Standard deviation of fading from pulse to pulse [dB]."""
    outlier_share: float = 0.02
    """Share of pulses that geometry does not explain: missed, of any strength by chance, or
    from another sender."""
    any_strength_db: float = 120.0
    """Range over which the powers of pulses that geometry does not explain are uniform [dB]."""
    threshold_db: float = 10.0
    """SNR above which a pulse is detected, if the data give no threshold [dB]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AcceptanceLimits:
    """Limits for accepting a bearing and for marking it as ambiguous."""

    evidence_nats: float = 3.0
    """Minimum log Bayes factor for a direction against none [nats], odds of 20 to 1. Fewer than
    1 % of turns with noise alone or with a steady interferer reach it."""
    second_lobe: float = 0.05
    """Probability of a second lobe from which a bearing is marked as ambiguous."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightTuning:
    """Limits for poses, pulses, turns and bearings that are read from a flight."""

    pose_step_ns: Resolution[int] = 180_000_000
    """Minimum time between two drone poses that are used [ns]; closer poses do not improve a
    turn."""
    pose_gap_ns: Guard[int] = 2_000_000_000
    """Gap between telemetry poses above which the poses stored with pulses are used [ns]."""
    most_missed: Guard[int] = 100_000
    """Maximum number of missed pulses of one tag in a flight, the number of pulses in one
    day."""
    reported_height_m: float = 20.0
    """Difference between reported height and elevation map from which a warning is given
    [m]."""
    least_tag_hz: Guard[float] = 1e6
    """Minimum frequency of a tag [Hz]; lower values in some logs are whole megahertz and are
    ignored."""
    hills_digits: Resolution[int] = 4
    """Power of ten to which frequencies are rounded to compute losses behind hills (4: 10
    kHz)."""

    own_heading_sigma_deg: float = 1.0
    """Minimum standard deviation of heading errors that differ from turn to turn [°]."""
    unknown_noise_sigma_deg: float = 4.0
    """Standard deviation of a bearing's error by noise from one side, if the noise was not
    measured [°]. Noise of 6 dB from a power line turns bearings by up to 9°; it is assumed for
    one turn in three."""
    miss_threshold_db: float = 13.0
    """SNR above which a detector that tracks a tag misses no pulse [dB]. Three pulses of 11.4
    dB are detected with a probability of 90 % (docs/reference); the rest is a margin for
    losses."""
    least_pulses: Guard[int] = 3
    """Minimum number of pulses in a drone's turn for a bearing."""
    least_turn_deg: float = 45.0
    """Minimum angle of a drone's turn in progress for a provisional bearing [°]."""
    whole_turn_deg: float = 270.0
    """Minimum angle of a drone's finished turn [°]."""
    in_progress_ns: Guard[int] = 10_000_000_000
    """Time before the last pose within which a turn may still be in progress [ns]."""
    one_flight_s: Guard[float] = 7200.0
    """Longest time span of bearings during which a tag may move [s]; over a longer span it is
    assumed to rest."""
    other_tag_hz: float = 10_000.0
    """Frequency difference above which one tag id means two tags [Hz]; the drift of a tag is
    smaller."""
    least_turns: Guard[int] = 3
    """Minimum number of full turns for learning an antenna's pattern."""
    learning_pulses: Guard[int] = 12
    """Minimum number of pulses in a turn from which the antenna's pattern is learned."""
    most_turns: Guard[int] = 24
    """Maximum number of turns from which the antenna's pattern is learned, to limit the
    computing time."""
    tick_ns: Guard[int] = 256
    """Resolution of times in pulse logs [ns], which store seconds since 1970 as floating-point
    numbers."""
    least_height_m: Guard[float] = 2.0
    """Lower limit of the antenna's height above the tag [m]."""
    place_sigma_m: float = 2.0
    """Standard deviation, in each direction, of the error common to all positions of a flight
    [m]. Single-frequency GNSS is off by 1.5 to 3 m for minutes."""
    gain_pulses: Guard[int] = 6
    """Number of pulses compared before and after a possible change of receiver gain."""
    gain_step_db: float = 3.0
    """Smallest step of the noise level that counts as a change of receiver gain [dB]."""

    live_turn_ns: Guard[int] = 900_000_000_000
    """Longest duration of a turn in flight [ns]; older poses and pulses are discarded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverTuning:
    """Limits for using signal levels of receivers that never turned."""

    one_place_m: Guard[float] = 20.0
    """Largest movement that may be GNSS noise at one position [m]. A receiver that moves less
    remains at one position; a flight that extends less gives no position from powers."""
    least_pulses: Guard[int] = 3
    """Minimum number of pulses at a position of a receiver that never turned for its level to
    be used."""
    most_places: Guard[int] = 24
    """Maximum number of a receiver's positions that are used, those with the most pulses."""
    received_share: Guard[float] = 0.5
    """Minimum share of the pulses that a receiver must receive; with fewer, its mean level is
    too high."""


POWER_LAW, LEVELS, ACCEPTANCE = PowerLawTuning(), LevelPriors(), AcceptanceLimits()
FLIGHT, RECEIVERS = FlightTuning(), ReceiverTuning()
