"""Estimate bearings from flights and pulse logs; each file is read once."""

import os
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

from uavrt.analysis.inputs.flown_with import USUAL_ANTENNA, flight_antenna, flight_settings
from uavrt.core.errors import FormatError, NotFound, UsageError
from uavrt.core.messages import PulsePose
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import flights_in_order, flown_before, flown_name
from uavrt.flight.reading.flight_reader import Flight, read_flight
from uavrt.flight.reading.noted_places import vehicle_of
from uavrt.flight.reading.recognise import read_pulse_log
from uavrt.formats.pulses.pulse_log import WITHOUT_HEADINGS, PulseLog
from uavrt.localization.antenna import MONOPOLE, AntennaPattern
from uavrt.localization.bearing.estimate_bearing import ADDED_METHODS
from uavrt.localization.estimates.flight_estimates import (
    EstimationOptions,
    HeardInTurn,
    TagBearing,
    bearings_of,
    corrected_antenna,
    heard_in_turns,
    learning_turns,
)
from uavrt.localization.estimates.heard import Heard
from uavrt.localization.results import BearingMethod
from uavrt.localization.tuning import FLIGHT

NO_BEARINGS_FROM_THESE = (
    "No bearing is computed from these poses; detect again in a recording with the poses of "
    "the autopilot's own log, or fly again."
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recorded:
    """A flight or pulse log as read from disk."""

    path: Path
    log: PulseLog
    flight: Flight | None

    @property
    def name(self) -> str:
        """Name of the flight or log for the operator, with the vehicle if recorded."""
        vehicle = None if self.flight is None else vehicle_of(self.flight.notes)
        return self.path.name if vehicle is None else f"{self.path.name} (vehicle {vehicle})"

    @property
    def antenna(self) -> str:
        """Name of the antenna pattern; monopole for logs without headings. Raises
        `UsageError`.
        """
        if self.flight is not None:
            return flight_antenna(self.flight)
        return MONOPOLE if self.log.kind in WITHOUT_HEADINGS else USUAL_ANTENNA

    def turning(self) -> str:
        """Name of the directional antenna, RA-23K if unknown. Raises `UsageError` for an
        upright whip, which gives no bearings.
        """
        if self.flight is None:
            return USUAL_ANTENNA
        if self.antenna == MONOPOLE:
            raise UsageError(
                "the drone was set up with an upright whip, which gives no bearings",
                remedy="Use uavrt localize, or name the antenna with --antenna",
            )
        return self.antenna

    def heard(self, antenna: str) -> Heard:
        """Pulses and poses as arrays; raises `UsageError` if no pulse has a pose."""
        if self.flight is not None:
            return heard_in_flight(self.flight, name=self.name, antenna=antenna)
        return Heard.of_records(self.log.pulse_poses, name=self.name, antenna=antenna)


def read_recorded(path: str | os.PathLike[str]) -> Recorded:
    """Read a flight or a pulse log of any known format; raises `FormatError` for others."""
    place = Path(path)
    if place.name == "flight.sqlite":
        place = place.parent
    if FlightLayout(place).database.is_file():
        flight = read_flight(place)
        log = PulseLog(kind="flight", pulse_poses=flight.pulse_poses)
        return Recorded(path=place, log=log, flight=flight)
    return Recorded(path=place, log=read_pulse_log(place), flight=None)


def heard_in_flight(
    flight: Flight,
    pulse_poses: Sequence[PulsePose] | None = None,
    *,
    name: str = "this flight",
    antenna: str = USUAL_ANTENNA,
) -> Heard:
    """Return the pulses of a flight, or those given, with their poses as arrays. Raises
    `UsageError` if no pulse has a pose.
    """
    return Heard.of_records(
        flight.pulse_poses if pulse_poses is None else pulse_poses,
        flight.poses,
        flight.on_ground_ns,
        tags=flight.info.tags,
        name=name,
        antenna=antenna,
    )


def bearings_together(
    recorded: Sequence[Recorded], how: EstimationOptions, warn: Callable[[str], None]
) -> list[TagBearing]:
    """Estimate bearings from flights and logs that were flown with the same antenna.

    The method ``pattern_ml`` first corrects the antenna pattern by all turns, including turns
    of past flights; `warn` is called with a sentence on the flights that were used.
    """
    check_method(how.bearing_method, (*get_args(BearingMethod), *ADDED_METHODS))
    antennas = [one.turning() if how.antenna is None else how.antenna for one in recorded]
    heard = [one.heard(USUAL_ANTENNA) for one in recorded]
    turns = [heard_in_turns(one, how.offset_deg) for one in heard]
    here = [one.flight for one in recorded if one.flight is not None]
    teaches = how.learn and how.bearing_method == "pattern_ml"
    found: list[TagBearing] = []
    taught: set[str] = set()
    for number, (one, antenna) in enumerate(zip(recorded, antennas, strict=True)):
        others = [
            each
            for other, each in enumerate(turns)
            if other != number and antennas[other] == antenna
        ]
        if one.flight is not None and how.learn:
            others += past_turns(one.flight, antenna, how.offset_deg, excluded=here)
        if teaches and (text := pattern_origin([turns[number], *others])):
            taught.add(text)
        past = [turn for flight in others for turn in flight]
        as_flown = replace(how, antenna=antenna)
        found += [
            replace(each, flight=number) for each in bearings_of(heard[number], as_flown, past)
        ]
    for text in sorted(taught):
        warn(text)
    return found


MOST_PAST_FLIGHTS = 6
"""Maximum number of past flights that are read to correct the antenna pattern; reading each
takes as long as reading the flight itself."""
ENOUGH_TURNS = 12
"""Number of turns after which more turns improve the corrected antenna pattern only little."""


def past_turns(
    flight: Flight,
    antenna: AntennaPattern | str,
    offset_deg: float = 0.0,
    *,
    excluded: Sequence[Flight] = (),
) -> list[list[HeardInTurn]]:
    """Pulses of each turn in past flights of the same drone and antenna, by flight.

    Flights in the same folder are read, newest first, until there are enough turns.
    """
    place = Path(flight.info.directory).resolve()
    names = {Path(one.info.directory).resolve().name for one in excluded}
    before = flown_before(place)
    neighbours = flights_in_order(place.parent) if before is None else before
    others = [path for path in neighbours if flown_name(path.name) != flown_name(place.name)]
    past = [path for path in others if path.name not in names]
    found: list[list[HeardInTurn]] = []
    for path in reversed(past[-MOST_PAST_FLIGHTS:]):
        if sum(map(len, map(learning_turns, found))) >= ENOUGH_TURNS:
            break
        try:
            other = read_flight(path)
            is_past = before is not None or (
                other.info.start_time_ns < flight.info.start_time_ns
            )
            if is_past and _set_up(other) == _set_up(flight):
                found.append(heard_in_turns(heard_in_flight(other), offset_deg))
        except (FormatError, UsageError):
            continue  # its turns are not needed
    return [one for one in found if one]


def _set_up(flight: Flight) -> tuple[Hashable, ...]:
    """Drone, antenna and mounting; flights with equal values share the antenna pattern."""
    settings = flight_settings(flight)
    mounted = None if settings is None else (settings.antenna, settings.bearings.antenna)
    return vehicle_of(flight.notes), mounted


def pattern_origin(flights: Sequence[Sequence[HeardInTurn]]) -> str | None:
    """Return a sentence that states how many turns of how many flights corrected the antenna
    pattern; None for a single flight.
    """
    turns = learning_turns(heard for flight in flights for heard in flight)
    used = sum(1 for flight in flights if any(one in turns for one in flight))
    if used < 2 or len(turns) < FLIGHT.least_turns:
        return None
    return f"the antenna's pattern was corrected by {len(turns)} turns of {used} flights"


def check_method(method: str, known: Sequence[str]) -> None:
    """Raise `UsageError` for an unknown estimation method, before any file is read."""
    if method not in known:
        raise NotFound(
            f"there is no method {method!r}", remedy=f"Choose from {', '.join(known)}"
        )


def learnt_antenna(recorded: Recorded, antenna: str, offset_deg: float = 0.0) -> AntennaPattern:
    """Correct an antenna pattern by at least three turns, so that it includes the airframe's
    effect. Raises `UsageError` for fewer turns.
    """
    turns = heard_in_turns(recorded.heard(antenna), offset_deg)
    if len(turns) < FLIGHT.least_turns:
        raise UsageError(
            f"{len(turns)} turns in which a tag was received are too few to learn an "
            "antenna pattern",
            remedy=f"Turn in place {FLIGHT.least_turns} times or more, or detect more tags",
        )
    return corrected_antenna(turns, antenna)
