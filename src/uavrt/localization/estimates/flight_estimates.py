"""Estimate turns, bearings, signal strengths and positions of a flight from its pulses and
poses.

Drone, web page, report, batch and command line all call this module, so that their results
agree.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import plane_around
from uavrt.core.errors import UsageError
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.localization.angles import widest_gap_deg
from uavrt.localization.antenna import MONOPOLE, AntennaPattern, pattern_named
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.bearing.learned_pattern import TurnPulses, learn_pattern
from uavrt.localization.bearing.turns import Turn, find_turns
from uavrt.localization.estimates.estimate_cache import Cache
from uavrt.localization.estimates.heard import (
    FlightGround,
    Heard,
    PoseColumns,
    PulseColumns,
    Rhythm,
)
from uavrt.localization.estimates.standing_receivers import strengths_of
from uavrt.localization.headings import Headings, yaws_deg
from uavrt.localization.position.bearings.observers import (
    AGREEMENT_ALONE,
    Displacement,
    Observer,
)
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.position.levels.strengths import Strengths
from uavrt.localization.position.tuning import COMMON, SURVEY
from uavrt.localization.results import (
    Bearing,
    BearingMethod,
    Caution,
    Position,
    PositionMethod,
)
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.tuning import FLIGHT, RECEIVERS

NO_TIME = -1
"""Value that marks a bearing's time as unknown [ns]; its tag is assumed to rest."""
EDGE_NS = NANOSECONDS_PER_SECOND
"""Time before and after a turn in which pulses still count as part of it [ns], since the
antenna hardly moves."""
NEVER_TURNED = (
    "it was detected, but not in a turn in place; receivers that do not turn add strengths "
    "to a position only if other receivers have bearings"
)
_SURVEY_ALONE = "this receiver's pulse strengths give a position by themselves"

_Floats = NDArray[np.float64]


_UNMEASURED_NOISE = Caution(
    name="noise",
    text=f"the noise was not measured, so {FLIGHT.unknown_noise_sigma_deg:.0f}° are added to "
    "the error of each bearing: noise from one side, such as from a power line, turns "
    "bearings",
)
_UNMEASURED_SURVEY_NOISE = Caution(
    name="noise",
    text="the noise was not measured: noise from one side, such as a power line's, may move "
    "this position farther than its circles show",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimationOptions:
    """Settings for estimating bearings and positions from a flight or log."""

    antenna: AntennaPattern | str | None = None
    """Antenna pattern, or its name; None for the flight's antenna."""
    offset_deg: float = 0.0
    """Direction of the boresight, clockwise from the heading that is stored with the pulses
    [deg]."""
    height_m: float | None = None
    """Height above the tags, for poses that have none [m]; used for positions from a monopole's
    signal strengths."""
    heading_sigma_deg: float = COMMON.heading_sigma_deg
    """Standard deviation of the error common to all headings of a flight [deg]."""
    height_sigma_m: float = SURVEY.height_sigma_m
    """Standard deviation of the error common to all heights above a tag [m]; used with a
    monopole."""
    displacement: float = 0.0
    """Standard deviation of a shift common to a tag's bearings, as a share of the distance to
    the tag."""
    elevation: Elevation | None = None
    """Terrain heights, from which the loss of pulses behind hills is computed; None for level
    ground."""
    bearing_method: BearingMethod | str = "pattern_ml"
    method: PositionMethod | str = "bayes"
    learn: bool = True
    """True to correct the antenna's pattern by full turns (``pattern_ml``)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TagBearing:
    """Bearing to a tag, with position and time of the antenna."""

    tag_id: int
    bearing: Bearing
    latitude_deg: float
    """Median latitude of the antenna at the pulses [deg]; longitude and altitude are also
    medians."""
    longitude_deg: float
    altitude_amsl_m: float
    start_time_ns: int
    """Time at or before the start of the first pulse [ns]."""
    middle_time_ns: int
    """Middle between the first and the last pulse [ns]; for a moving tag, the bearing refers to
    this time."""
    end_time_ns: int
    """Time at or after the start of the last pulse [ns]."""
    heard: int = 0
    turn: Turn | None = None
    """Turn from which the bearing was estimated; None if unknown."""
    number: int = 0
    """Number of the bearing's turn in the flight, counted from 0."""
    from_drone: bool = False
    flight: int = 0
    """Index of the flight or log; while a position is estimated, index of the receiver."""
    by_hand: bool = False
    observer: Observer | None = None
    """Error model of the person who took the bearing by hand; None if unknown."""
    noise_known: bool = True
    """False if the noise was not measured; `bearing` then allows for noise that depends on the
    direction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TagPosition:
    """Estimated position of a tag, or the reason why none could be estimated."""

    tag_id: int
    position: Position | None
    reason: str | None = None
    frequency_hz: float | None = None
    """Median frequency of the tag's pulses [Hz]; None if no log with pulses was read."""
    name: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """One receiver's bearings and signal levels of tags, from which positions are estimated."""

    bearings: Sequence[TagBearing] = ()
    """Bearings in order of time and tag."""
    strengths: Mapping[int, Strengths] = field(default_factory=dict)
    """Signal levels of received tags that have no bearing, by tag id."""
    heard: frozenset[int] = frozenset()
    """Ids of tags of which at least one pulse was received."""
    frequencies_hz: Mapping[int, float] = field(default_factory=dict)
    """Frequencies of received or listed tags [Hz], by tag id."""
    pattern: AntennaPattern | None = None
    """Antenna pattern after correction by the flight's turns; None if there was no turn."""

    def bearings_of(self, tag_id: int) -> list[TagBearing]:
        """Bearings of one tag."""
        return [one for one in self.bearings if one.tag_id == tag_id]

    def has_tag(self, tag_id: int) -> bool:
        """True if there is a bearing or a signal level of a tag."""
        return tag_id in self.strengths or bool(self.bearings_of(tag_id))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimated:
    """All bearings and positions of a flight."""

    found: Found
    positions: tuple[TagPosition, ...]
    tracks: Mapping[int, PowerTrack] = field(default_factory=dict)
    """Pulse powers along the flight from which positions by signal strength were estimated, by
    tag id."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeardInTurn:
    """Pulses of one tag during one turn."""

    tag_id: int
    turn: Turn
    number: int
    """Number of the turn in the flight, counted from 0."""
    pulses: PulseColumns
    missed_yaw_deg: _Floats
    """Headings of the antenna at expected pulses that were not received [deg], shape (m,)."""

    @property
    def whole(self) -> bool:
        """True if the turn spans at least `FLIGHT.whole_turn_deg`."""
        return abs(self.turn.turned_deg) >= FLIGHT.whole_turn_deg

    @property
    def snr_db(self) -> _Floats:
        """SNR of the pulses [dB], shape (n,)."""
        return self.pulses.snr_db

    @property
    def subject(self) -> tuple[int, int]:
        """Key of tag and turn in the cache, which does not change while the turn is in
        progress.
        """
        return self.tag_id, int(self.pulses.time_ns[0])


def turns_in(
    poses: PoseColumns, *, least_turn_deg: float = FLIGHT.whole_turn_deg
) -> list[Turn]:
    """Find the turns of a flight, including one in progress."""
    if len(poses.time_ns) < 4 or poses.on_ground.all():
        return []  # earlier times in flight are no longer among these poses
    every = find_turns(
        poses.time_ns,
        poses.yaw_deg,
        poses.latitude_deg,
        poses.longitude_deg,
        height_m=poses.flown_m,
        on_ground=poses.on_ground,
        least_turn_deg=FLIGHT.least_turn_deg,
    )
    last_ns = int(poses.time_ns[-1])
    return [
        turn
        for turn in every
        if abs(turn.turned_deg) >= least_turn_deg
        or last_ns - turn.end_time_ns <= FLIGHT.in_progress_ns
    ]


def heard_in_turns(heard: Heard, offset_deg: float = 0.0) -> list[HeardInTurn]:
    """Return the pulses of each tag in each turn in place, if at least three, in order of time
    and tag.
    """
    pulses = {tag_id: own.turned(offset_deg) for tag_id, own in sorted(heard.pulses.items())}
    rhythms = {tag.tag_id: Rhythm.of(tag) for tag in heard.tags}
    yaw_deg = np.unwrap(heard.poses.yaw_deg, period=360.0)
    if heard.one_turn:
        return [_whole_log(tag_id, own, heard.poses) for tag_id, own in pulses.items()]
    found = []
    for number, turn in enumerate(turns_in(heard.poses)):
        edges = [turn.start_time_ns - EDGE_NS, turn.end_time_ns + EDGE_NS + 1]
        for tag_id, own in pulses.items():
            first, last = map(int, np.searchsorted(own.time_ns, edges))
            if last - first >= FLIGHT.least_pulses:
                near = own.chosen(slice(max(0, first - 1), last + 1))
                missed = _missed_yaws_deg(
                    near, heard.poses.time_ns, yaw_deg, turn, rhythms.get(tag_id)
                )
                found.append(
                    HeardInTurn(
                        tag_id=tag_id,
                        turn=turn,
                        number=number,
                        pulses=own.chosen(slice(first, last)),
                        missed_yaw_deg=missed,
                    )
                )
    return found


def _whole_log(tag_id: int, pulses: PulseColumns, poses: PoseColumns) -> HeardInTurn:
    yaw = np.unwrap(poses.yaw_deg, period=360.0)
    turn = Turn(
        start_time_ns=int(poses.time_ns[0]),
        end_time_ns=int(poses.time_ns[-1]),
        turned_deg=float(yaw[-1] - yaw[0]),
        stops=0,
        widest_gap_deg=widest_gap_deg(yaw),
        latitude_deg=float(np.median(pulses.latitude_deg)),
        longitude_deg=float(np.median(pulses.longitude_deg)),
    )
    return HeardInTurn(
        tag_id=tag_id, turn=turn, number=0, pulses=pulses, missed_yaw_deg=np.zeros(0)
    )


def _missed_yaws_deg(
    pulses: PulseColumns,
    pose_ns: NDArray[np.int64],
    yaw_deg: _Floats,
    turn: Turn,
    rhythm: Rhythm | None,
) -> _Floats:
    """Headings of the antenna at expected pulses of a turn that were not received [deg]."""
    times = pulses.missed_ns(rhythm)
    inside = times[(times >= turn.start_time_ns) & (times <= turn.end_time_ns)]
    if not len(inside):
        return inside
    off_deg = yaws_deg(pulses.quaternion_wxyz) - np.interp(pulses.time_ns, pose_ns, yaw_deg)
    offset = np.angle(np.mean(np.exp(1j * np.radians(off_deg))), deg=True)
    return np.asarray(np.remainder(np.interp(inside, pose_ns, yaw_deg) + offset, 360.0))


def _bearing_of(
    tag_id: int,
    pulses: PulseColumns,
    missed_yaw_deg: _Floats,
    pattern: AntennaPattern,
    method: BearingMethod | str,
) -> TagBearing:
    half = np.radians(missed_yaw_deg) / 2.0
    nothing = np.zeros(len(half))
    missed = np.stack([np.cos(half), nothing, nothing, np.sin(half)], axis=1)
    noise_db = np.concatenate([pulses.noise_db, np.zeros(len(half))])
    unmeasured_deg = 0.0 if pulses.noise_known else FLIGHT.unknown_noise_sigma_deg
    bearing = estimate_bearing(
        None,
        np.concatenate([pulses.snr_db, np.full(len(half), np.nan)]),
        method=method,
        antenna=pattern,
        quaternion_wxyz=np.concatenate([pulses.quaternion_wxyz, missed]),
        noise_psd=10.0 ** (noise_db / 10.0),
        threshold_db=FLIGHT.miss_threshold_db,
        heading_sigma_deg=math.hypot(FLIGHT.own_heading_sigma_deg, unmeasured_deg),
    )
    first_ns, last_ns = int(pulses.time_ns[0]), int(pulses.time_ns[-1])
    return TagBearing(
        tag_id=tag_id,
        bearing=bearing,
        latitude_deg=float(np.median(pulses.latitude_deg)),
        longitude_deg=float(np.median(pulses.longitude_deg)),
        altitude_amsl_m=float(np.median(pulses.altitude_amsl_m)),
        start_time_ns=first_ns - FLIGHT.tick_ns // 2,
        middle_time_ns=(first_ns + last_ns) // 2,
        end_time_ns=last_ns + FLIGHT.tick_ns // 2,
        heard=len(pulses.snr_db),
        noise_known=pulses.noise_known,
    )


def _in_turn(one: TagBearing, turn: Turn, number: int) -> TagBearing:
    return replace(one, turn=turn, number=number)


def learning_turns(heard: Iterable[HeardInTurn]) -> list[HeardInTurn]:
    """Select the turns from which the antenna's pattern is learned: complete turns with many
    pulses.
    """
    whole = [one for one in heard if one.whole and len(one.snr_db) >= FLIGHT.learning_pulses]
    return whole[: FLIGHT.most_turns]


def corrected_antenna(
    heard: Sequence[HeardInTurn], antenna: AntennaPattern | str
) -> AntennaPattern:
    """Correct the antenna's pattern by full turns; if there are too few, it is returned
    unchanged.
    """
    whole = learning_turns(heard)
    pattern = pattern_named(antenna)
    if len(whole) < FLIGHT.least_turns:
        return pattern
    turns = [
        TurnPulses(
            yaw_deg=np.concatenate(
                [
                    Headings.from_quaternions(one.pulses.quaternion_wxyz).yaw_deg,
                    one.missed_yaw_deg,
                ]
            ),
            matched_power=np.concatenate(
                [1.0 + 10.0 ** (one.snr_db / 10.0), np.full(len(one.missed_yaw_deg), np.nan)]
            ),
        )
        for one in whole
    ]
    return learn_pattern(turns, pattern, threshold_db=FLIGHT.miss_threshold_db)


def antenna_of(heard: Heard, how: EstimationOptions) -> AntennaPattern | str:
    """Return the antenna pattern (or its name) from the options; by default that of the
    receiving antenna.
    """
    return heard.antenna if how.antenna is None else how.antenna


def learnt_pattern(
    heard: Heard,
    how: EstimationOptions,
    turns: Sequence[HeardInTurn],
    past: Sequence[HeardInTurn] = (),
    cache: Cache | None = None,
) -> AntennaPattern:
    """Learn the antenna's pattern from complete turns of this flight and of `past` flights."""
    antenna = antenna_of(heard, how)
    if not (how.learn and how.bearing_method == "pattern_ml" and turns):
        return pattern_named(antenna)
    over_ns = math.inf
    if heard.goes_on and len(heard.poses.time_ns):
        over_ns = int(heard.poses.time_ns[-1]) - 2 * EDGE_NS
    shown = [*(one for one in turns if one.turn.end_time_ns < over_ns), *past]
    return (cache or Cache()).get(corrected_antenna, learning_turns(shown), antenna)


def bearings_of(
    heard: Heard,
    how: EstimationOptions | None = None,
    past: Sequence[HeardInTurn] = (),
    cache: Cache | None = None,
) -> list[TagBearing]:
    """Estimate one bearing for each tag and each turn in place, in order of time and tag.

    Pulses that a known interval predicts but that were not received count as missed pulses.
    """
    return _bearings(heard, how or EstimationOptions(), past, cache or Cache())[0]


def _bearings(
    heard: Heard, how: EstimationOptions, past: Sequence[HeardInTurn], cache: Cache
) -> tuple[list[TagBearing], AntennaPattern | None]:
    turns = heard_in_turns(heard, how.offset_deg)
    if not turns:
        return [], None
    pattern = learnt_pattern(heard, how, turns, past, cache)
    found: dict[int, TagBearing | None] = {}
    for number in cache.waiting("bearing", [one.subject for one in turns]):
        found[number] = _tag_bearing(turns[number], pattern, how.bearing_method, cache)
    ordered = [found[number] for number in range(len(turns))]
    return [one for one in ordered if one is not None], pattern


def _tag_bearing(
    one: HeardInTurn, pattern: AntennaPattern, method: BearingMethod | str, cache: Cache
) -> TagBearing | None:
    """Estimate the bearing of a tag in a turn; if the cache defers the update, return the
    previous bearing.
    """
    made_of = one.tag_id, one.pulses, one.missed_yaw_deg, pattern, method
    known = cache.latest("bearing", one.subject, _bearing_of, *made_of)
    return None if known is None else cache.get(_in_turn, known, one.turn, one.number)


def find(
    heard: Heard,
    how: EstimationOptions | None = None,
    past: Sequence[HeardInTurn] = (),
    theirs: Sequence[TagBearing] = (),
    cache: Cache | None = None,
) -> Found:
    """Estimate a receiver's bearings, and the signal levels of tags that have no bearing.

    A bearing in `theirs`, which the drone estimated, replaces one estimated here from fewer
    pulses of the same turn. The other parameters are those of `bearings_of`.
    """
    how, cache = how or EstimationOptions(), cache or Cache()
    if antenna_of(heard, how) == MONOPOLE:
        return with_strengths(heard, how, [], cache)
    own, pattern = _bearings(heard, how, past, cache)
    found = with_strengths(heard, how, _with_theirs(own, theirs), cache)
    return replace(found, pattern=pattern)


def with_strengths(
    heard: Heard,
    how: EstimationOptions,
    bearings: Sequence[TagBearing],
    cache: Cache | None = None,
) -> Found:
    """Combine a receiver's bearings with the signal levels of its tags that have no bearing."""
    cache = cache or Cache()
    turned = {
        one.tag_id
        for one in bearings
        if one.bearing.accepted
        or (one.tag_id in heard.pulses and _is_of_turn(heard.pulses[one.tag_id]))
    }
    return Found(
        bearings=bearings,
        strengths={
            tag_id: _strengths(heard, how, tag_id, cache)
            for tag_id in sorted(heard.pulses.keys() - turned)
        },
        heard=frozenset(heard.pulses),
        frequencies_hz=heard.frequencies_hz,
    )


def _strengths(heard: Heard, how: EstimationOptions, tag_id: int, cache: Cache) -> Strengths:
    antenna = antenna_of(heard, how)
    own = heard.pulses[tag_id].turned(0.0 if antenna == MONOPOLE else how.offset_deg)
    return cache.get(
        strengths_of,
        heard.name,
        own,
        heard.poses.heights_m(own.time_ns),
        heard.poses.on_ground_ns,
        antenna,
        heard.rhythm(tag_id),
    )


def _is_of_turn(pulses: PulseColumns) -> bool:
    """True if the antenna's headings at the pulses span at least 45°, enough for a turn."""
    yaw = np.unwrap(yaws_deg(pulses.quaternion_wxyz), period=360.0)
    return float(np.ptp(yaw)) >= FLIGHT.least_turn_deg


def _with_theirs(own: Sequence[TagBearing], theirs: Sequence[TagBearing]) -> list[TagBearing]:
    found = list(own)
    turns = 1 + max((one.number for one in own), default=-1)
    for one in theirs:
        ours = [each for each in found if each.tag_id == one.tag_id and _overlap(each, one)]
        if any(each.heard >= one.heard for each in ours):
            continue
        found = [each for each in found if each not in ours]
        found.append(replace(one, number=ours[0].number if ours else turns))
    return sorted(found, key=lambda one: (_begins(one), one.tag_id)) if theirs else found


def _overlap(one: TagBearing, other: TagBearing) -> bool:
    if one.turn is None or other.turn is None:
        return False
    begin_ns = max(one.turn.start_time_ns, other.turn.start_time_ns)
    return begin_ns <= min(one.turn.end_time_ns, other.turn.end_time_ns)


def _begins(one: TagBearing) -> int:
    return one.start_time_ns if one.turn is None else one.turn.start_time_ns


def estimate(
    heard: Heard,
    how: EstimationOptions | None = None,
    *,
    past: Sequence[HeardInTurn] = (),
    theirs: Sequence[TagBearing] = (),
    others: Sequence[Found] = (),
    cache: Cache | None = None,
    at_once: Mapping[str, int] = MappingProxyType({}),
) -> Estimated:
    """Estimate all bearings and positions of a flight or log.

    `past`: turns of earlier flights, from which the antenna's pattern is also learned.
    `theirs`: bearings estimated on the drone. `others`: results of other receivers; they are
    used for a tag if its id has the same frequency there. `cache`: keeps unchanged results for
    repeated calls. `at_once`: maximum number of new ``"bearing"``, ``"position"`` and
    ``"survey"`` results; see `Cache.begin`. Raises `UsageError` for an unknown method or
    antenna, or if the method cannot use the pulses.
    """
    how, cache = how or EstimationOptions(), cache or Cache()
    cache.begin(at_once)
    over = _over(heard, how, cache)
    found = find(heard, how, past, theirs, cache)
    alone: dict[int, TagPosition] = {}
    tracks: dict[int, PowerTrack] = {}
    if antenna_of(heard, how) == MONOPOLE:
        alone, tracks = survey(heard, how, over, cache)
        strengths = {
            tag_id: replace(own, unused=_SURVEY_ALONE)
            if tag_id in alone and alone[tag_id].position
            else own
            for tag_id, own in found.strengths.items()
        }
        found = replace(found, strengths=strengths)
    positions = {one.tag_id: one for one in place([found, *others], how, over, cache)}
    for tag_id, one in alone.items():
        if (
            one.position is not None
            or tag_id not in positions
            or not positions[tag_id].position
        ):
            positions[tag_id] = one
    return Estimated(
        found=found,
        positions=tuple(positions[tag_id] for tag_id in sorted(positions)),
        tracks=tracks,
    )


def _over(heard: Heard, how: EstimationOptions, cache: Cache) -> FlightGround | None:
    return heard.over(how.elevation, partial(cache.get, HillLosses))


def place(
    found: Sequence[Found],
    how: EstimationOptions | None = None,
    over: FlightGround | None = None,
    cache: Cache | None = None,
) -> list[TagPosition]:
    """Estimate the position of each tag that has bearings or whose pulses the first receiver
    received.
    """
    how, cache = how or EstimationOptions(), cache or Cache()
    tags = {one.tag_id for each in found for one in each.bearings}
    every = sorted(tags.union(*(each.heard for each in found[:1])))
    placed: dict[int, TagPosition | None] = {}
    for number in cache.waiting("position", every):
        tag_id = every[number]
        placed[tag_id] = _placed(tag_id, _of_tag(tag_id, found), how, over, cache)
    return [one for tag_id in every if (one := placed[tag_id]) is not None]


def _of_tag(tag_id: int, found: Sequence[Found]) -> list[Found]:
    """Select the receivers for which a tag id means the same animal, by the tag's frequency."""
    known_by = [*found[:1], *(each for each in found[1:] if each.has_tag(tag_id))]
    hz = [each.frequencies_hz[tag_id] for each in known_by if tag_id in each.frequencies_hz]
    if not hz:
        return list(found)
    return [
        each
        for each in found
        if abs(each.frequencies_hz.get(tag_id, hz[0]) - hz[0]) <= FLIGHT.other_tag_hz
    ]


def _placed(
    tag_id: int,
    found: Sequence[Found],
    how: EstimationOptions,
    over: FlightGround | None,
    cache: Cache,
) -> TagPosition | None:
    # Separate gains: two flights may be of two drones under one number, and a common gain
    # reduces circles by less than 4 %.
    bearings = [
        replace(one, flight=number)
        for number, each in enumerate(found)
        for one in each.bearings_of(tag_id)
    ]
    if not bearings:
        return TagPosition(tag_id=tag_id, position=None, reason=NEVER_TURNED)
    bearings.sort(key=_begins)
    observers = [one.observer for one in bearings]
    alone = observers[0] if len(set(observers)) == 1 else None
    bearings = [
        replace(one, bearing=by.corrected(one.bearing, 0 if alone else observers.count(by)))
        if (by := one.observer)
        else one
        for one in bearings
    ]
    listeners = [each.strengths[tag_id] for each in found if tag_id in each.strengths]
    try:
        stations = _stations(bearings, over, listeners)
    except UsageError as error:
        return TagPosition(tag_id=tag_id, position=None, reason=str(error))
    hills = None if over is None else over.hills
    sigma_deg = alone.heading_error_sigma_deg if alone else how.heading_sigma_deg
    displacement = how.displacement or (alone.displacements if alone else 0.0)
    unknown = not displacement and any(one.by_hand and not one.observer for one in bearings)
    noisy = not all(one.noise_known for one in bearings)
    notes = (AGREEMENT_ALONE,) * unknown + (_UNMEASURED_NOISE,) * noisy
    known = tuple(sorted({one.sentence for one in observers if one}))
    made_of = tag_id, stations, how.method, sigma_deg, displacement, hills, notes, known
    return cache.latest("position", tag_id, _position_of, *made_of)


def _stations(
    bearings: Sequence[TagBearing], over: FlightGround | None, listeners: Sequence[Strengths]
) -> Stations:
    used = [one for one in bearings if one.bearing.accepted]
    if not used:
        raise UsageError(
            "none of the tag's bearings has a clear direction", remedy="Fly nearer to the tag"
        )
    origin_ns = min(one.middle_time_ns for one in used)
    times_s = [(one.middle_time_ns - origin_ns) / NANOSECONDS_PER_SECOND for one in used]
    stations = Stations.of(
        [one.latitude_deg for one in used],
        [one.longitude_deg for one in used],
        [one.bearing for one in used],
        times_s if origin_ns != NO_TIME and max(times_s) <= FLIGHT.one_flight_s else None,
        origin_ns,
    )
    height_m = None if over is None else over.heights_m([one.middle_time_ns for one in used])
    receiver = np.array([one.flight for one in used], np.int64)
    return replace(stations, receiver=receiver, height_m=height_m, listeners=tuple(listeners))


def _position_of(
    tag_id: int,
    stations: Stations,
    method: PositionMethod | str,
    heading_sigma_deg: float,
    displacement: float | tuple[Displacement, ...],
    hills: HillLosses | None,
    notes: tuple[Caution, ...],
    observers: tuple[str, ...],
) -> TagPosition:
    """Estimate a tag's position, and also its path if the bearings contradict a fixed
    position.
    """
    try:
        found = estimate_position(
            stations,
            method=method,
            heading_sigma_deg=heading_sigma_deg,
            displacement=displacement,
            follow=True,
            hills=hills,
        )
    except UsageError as error:
        # One tag with a single bearing must not remove the others from the list.
        return TagPosition(tag_id=tag_id, position=None, reason=str(error))
    if method not in ("bayes", "track") and stations.listeners:
        left_out = f"the method {method} uses bearings only"
        listeners = tuple(one.because(left_out) for one in stations.listeners)
        found = replace(found, listeners=listeners)
    notes = (*found.cautions, *notes)
    found = replace(found, cautions=notes, listeners=found.listeners + observers)
    return TagPosition(tag_id=tag_id, position=found)


def survey(
    heard: Heard,
    how: EstimationOptions,
    over: FlightGround | None = None,
    cache: Cache | None = None,
) -> tuple[dict[int, TagPosition], dict[int, PowerTrack]]:
    """Return positions and powers by tag id, from signal strength alone. Raises `UsageError` if
    the method needs bearings.
    """
    cache = cache or Cache()
    if how.method not in ("bayes", "track"):
        raise UsageError(
            f"{how.method} needs bearings, but a monopole gives none",
            remedy="Use the method bayes, or track",
        )
    positions: dict[int, TagPosition] = {}
    tracks: dict[int, PowerTrack] = {}
    every = sorted(heard.pulses)
    hills = None if over is None else over.hills
    for number in cache.waiting("survey", every):
        tag_id = every[number]
        try:
            track = power_track(heard, tag_id, how.height_m)
        except UsageError as error:
            positions[tag_id] = TagPosition(tag_id=tag_id, position=None, reason=str(error))
            continue
        noise_known = heard.pulses[tag_id].noise_known
        made_of = tag_id, track, how.method, how.height_sigma_m, hills, noise_known
        found = cache.latest("survey", tag_id, _surveyed, *made_of)
        if found is not None:
            positions[tag_id] = found[0]
            if found[0].position is not None:
                tracks[tag_id] = found[1]
    return positions, tracks


def _surveyed(
    tag_id: int,
    track: PowerTrack,
    method: PositionMethod | str,
    height_sigma_m: float,
    hills: HillLosses | None,
    noise_known: bool,
) -> tuple[TagPosition, PowerTrack]:
    try:
        position = estimate_position(
            None, track, method=method, height_sigma_m=height_sigma_m, follow=True, hills=hills
        )
    except UsageError as error:
        return TagPosition(tag_id=tag_id, position=None, reason=str(error)), track
    if not noise_known:
        position = replace(position, cautions=(*position.cautions, _UNMEASURED_SURVEY_NOISE))
    return TagPosition(tag_id=tag_id, position=position), track


def power_track(heard: Heard, tag_id: int, height_m: float | None = None) -> PowerTrack:
    """Return the powers of a tag's received pulses along a flight and, for a listed tag, its
    missed pulses.
    """
    own, poses = heard.pulses[tag_id], heard.poses
    if len(own.time_ns) < 3:
        raise UsageError(
            f"only {len(own.time_ns)} of the tag's pulses have a position, three are needed",
            remedy="Fly nearer to the tag",
        )
    noise_db = own.noise_db
    columns = [own.latitude_deg, own.longitude_deg, own.height_m, noise_db, own.snr_db]
    missed = np.rint(own.missed_ns(heard.rhythm(tag_id))).astype(np.int64)
    times_ns = own.time_ns
    if len(missed) and len(poses.time_ns) > 1:
        known = poses.latitude_deg, np.unwrap(poses.longitude_deg, period=360.0), poses.height_m
        there = [np.interp(missed, poses.time_ns, values) for values in known]
        there.append(np.interp(missed, own.time_ns, noise_db))
        added = [*there, np.full(len(missed), np.nan)]
        columns = [np.append(one, more) for one, more in zip(columns, added, strict=True)]
        times_ns = np.append(times_ns, missed)
    order = np.argsort(times_ns, kind="stable")
    latitude, longitude, height, noise_db, snr_db = (column[order] for column in columns)
    times_ns = times_ns[order]
    times_s = (times_ns - times_ns[0]) / NANOSECONDS_PER_SECOND
    if height_m is not None:
        height = np.where(np.isfinite(height), height, height_m)
    if not np.isfinite(height).all():
        raise UsageError(
            "the log contains no heights above the ground",
            remedy="Give the drone's height above the tags, for example --height 40",
        )
    return PowerTrack(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.maximum(height, FLIGHT.least_height_m),
        snr_db=snr_db + noise_db,
        threshold_db=FLIGHT.miss_threshold_db + noise_db,
        time_s=times_s if times_s[-1] <= FLIGHT.one_flight_s else None,
        origin_ns=int(times_ns[0]),
    )


def at_one_place(heard: Heard) -> bool:
    """True if all pulses were received at one position, so that signal strength gives no
    position.
    """
    own = heard.pulses.values()
    if not own:
        return False
    latitude = np.concatenate([one.latitude_deg for one in own])
    longitude = np.concatenate([one.longitude_deg for one in own])
    away_m = np.hypot(*plane_around(latitude, longitude).to_local(latitude, longitude))
    return float(np.quantile(away_m, 0.95)) < RECEIVERS.one_place_m
