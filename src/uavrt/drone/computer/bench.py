"""Check before a first flight whether a drone is ready, at the drone or over its link.

`first_flight` evaluates the records and other facts, for ``uavrt doctor --flight`` and the
page.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf, isfinite, log10
from statistics import median

from uavrt.core.commands import SystemState
from uavrt.core.messages import Poses, PulsePose, SearchReport, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, rough_duration
from uavrt.drone.computer.finding import Finding, failed, passed

DETECTOR_SILENT_S = 15.0
"""Time without a report from any detector that counts as a fault [s]; over the link, each
detector reports every 6 s."""
POSE_OLD_S = 2.0
"""Age of the newest position that counts as a fault [s]; usually five arrive per second."""
HEARD_S = 60.0
"""Largest age at which the last pulse of the test tag still counts as received [s]."""
NOISE_RISE_DB = 6.0
"""Increase of a tag's noise level since its lowest value that counts as a fault [dB]; such an
increase halves the detection range."""
NOISE_APART_DB = 10.0
"""Noise difference between two tag frequencies that is a fault [dB]; 3 dB is usual."""
NOISE_LESS_DB = 10.0
"""How far the noise may be below that of past flights before it counts as a fault [dB]. Low
noise shows a disconnected antenna or a low gain."""
CLOCK_OFF_S = 3.0
"""Clock difference of drone and ground station that counts as a fault [s]."""
BATTERY_PERCENT = 50.0
"""Battery charge below which a first flight should not start [%]."""
NOISE_REMEDY = (
    "Switch off nearby devices, one after the other (camera, video link, chargers), and "
    "keep cables away from the antenna"
)


LEVEL_REMEDY = (
    "If the gain is as in past flights: switch off nearby devices, one after the other "
    "(camera, video link, chargers), and keep cables away from the antenna"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightFacts:
    """Inputs of a bench check that are not in the drone's records; None if unknown."""

    tags: tuple[Tag, ...]
    state: SystemState | None
    heard: bool
    """True if the drone answers on its link."""
    own_findings: tuple[Finding, ...] = ()
    """Results of the checks of this computer; each replaces the check of the drone with the
    same name."""
    time_known: bool | None = None
    """True if the autopilot's clock is known; None if another check covers it."""
    clock_off_s: float | None = None
    pose_age_s: float | None = None
    """Age of the newest position [s]; None without a position."""
    disk_free_mb: float | None = None
    disk_needed_mb: float = 0.0
    battery_percent: float | None = None
    battery_v: float | None = None
    usual_noise_db: float | None = None
    """Noise level of the receiver before take-off in past flights [dB]; None if unknown."""


@dataclass(slots=True)
class _Heard:
    """Noise level, and times of the latest pulse and detector report, for one tag."""

    detector_ns: int | None = None
    pulse_ns: int | None = None
    clipped: bool = False
    noise_db: float | None = None
    quietest_db: float = inf


@dataclass(slots=True)
class Bench:
    """Latest pulse, noise level and position of the drone under check, with arrival times."""

    tags: dict[int, _Heard] = field(default_factory=dict)
    pose_ns: int | None = None
    posed: bool | None = None
    """True if the newest pulse has a position; None before the first pulse."""

    def add(self, record: object, now_ns: int) -> None:
        """Add a record; only pulses, search reports and poses are used."""
        match record:
            case PulsePose():
                one = self.alive(record.pulse.tag_id, now_ns)
                if record.pulse.confirmed:
                    one.pulse_ns, one.clipped = now_ns, record.pulse.clipped
                self.posed = record.pose is not None
                _add_noise(one, record.pulse.noise_psd)
            case SearchReport():
                _add_noise(self.alive(record.tag_id, now_ns), record.noise_psd)
            case Poses():
                self.pose_ns = now_ns

    def alive(self, tag_id: int, now_ns: int) -> _Heard:
        """Note that the detector of a tag works now; return the tag's entry."""
        one = self.tags.setdefault(tag_id, _Heard())
        one.detector_ns = now_ns
        return one

    def reset(self) -> None:
        """Discard all records, for another drone or after this drone was moved."""
        self.tags.clear()
        self.pose_ns = self.posed = None

    def noise(self, tags: Iterable[Tag]) -> dict[int, _Heard]:
        """Return the noise records of the given tags, by tag id; without unmeasured tags."""
        ids = {tag.tag_id for tag in tags}
        return {
            tag_id: one
            for tag_id, one in self.tags.items()
            if tag_id in ids and one.noise_db is not None
        }


def _add_noise(one: _Heard, noise_psd: float) -> None:
    if isfinite(noise_psd) and noise_psd > 0.0:
        one.noise_db = 10.0 * log10(noise_psd)
        one.quietest_db = min(one.quietest_db, one.noise_db)


def first_flight(facts: FlightFacts, bench: Bench, now_ns: int) -> list[Finding]:
    """Return the result of every check before a first flight; missing data are a fault."""
    judged = [
        _drone(facts),
        _radio(facts, bench, now_ns),
        _noise(facts, bench),
        _time(facts, bench),
        _poses(facts),
        _tags(facts, bench, now_ns),
        _disk(facts),
        _battery(facts),
    ]
    if not facts.heard:
        judged = [_without_drone(finding) for finding in judged]
    own = {finding.what: finding for finding in facts.own_findings}
    return [own.pop(finding.what, finding) for finding in judged] + list(own.values())


def _without_drone(finding: Finding) -> Finding:
    if finding.ok or finding.what in ("drone", "tags"):
        return finding
    return failed(finding.what, "unknown: no contact with the drone", "Waiting for the drone")


def _open(what: str, text: str, remedy: str) -> Finding:
    return Finding(what=what, ok=False, open=True, text=text, remedy=remedy)


def _drone(facts: FlightFacts) -> Finding:
    if facts.heard:
        return passed("drone", "the drone is connected")
    return failed(
        "drone",
        "no contact with the drone",
        "Check the drone's power, the telemetry radio and the connection under Set-up",
    )


def _radio(facts: FlightFacts, bench: Bench, now_ns: int) -> Finding:
    what = "radio"
    if facts.state is not SystemState.DETECTING:
        return failed(
            what,
            "the radio was not tested, because no detection is running",
            "Send the tags and press Start, with the propellers off",
        )
    ages = [_age_s(one.detector_ns, now_ns) for one in bench.tags.values()]
    if min(ages, default=inf) <= DETECTOR_SILENT_S:
        return passed(what, "samples from the radio arrive and are searched for pulses")
    return failed(
        what,
        "no report from the detector arrives",
        "Press Radio status under Set-up; check the radio's cable and power supply",
    )


def _noise(facts: FlightFacts, bench: Bench) -> Finding:
    what = "noise"
    known = bench.noise(facts.tags)
    if not known:
        return failed(
            what,
            "the noise has not been measured yet",
            "Press Start and wait half a minute for a measurement",
        )
    names = {tag.tag_id: _megahertz(tag) for tag in facts.tags}
    levels = {tag_id: one.noise_db or 0.0 for tag_id, one in known.items()}
    rises = {tag_id: levels[tag_id] - one.quietest_db for tag_id, one in known.items()}
    worst = max(rises, key=rises.__getitem__)
    if rises[worst] > NOISE_RISE_DB:
        text = f"the noise has risen by {rises[worst]:.0f} dB at {names[worst]} MHz"
        return failed(what, text, NOISE_REMEDY)
    loudest = max(levels, key=levels.__getitem__)
    apart_db = levels[loudest] - min(levels.values())
    if apart_db > NOISE_APART_DB:
        at = names[loudest]
        text = (
            f"the noise is {apart_db:.0f} dB stronger at {at} MHz than at the frequency of "
            "the quietest tag"
        )
        return failed(what, text, NOISE_REMEDY)
    return _level(what, levels, apart_db, facts.usual_noise_db)


def _level(
    what: str, levels: dict[int, float], apart_db: float, usual_db: float | None
) -> Finding:
    """Compare the tags' noise levels [dB] with those of past flights.

    The levels must already be similar on all tags, and steady.
    """
    even = f"the noise is steady, and equal within {apart_db:.0f} dB on all tags"
    if usual_db is None:
        return _open(
            what,
            f"{even}; there is no past flight to compare with",
            "Switch on camera, video link and motors, one after the other, and check that the "
            "noise stays the same. Later flights are compared with the first",
        )
    more_db = median(levels.values()) - usual_db
    if more_db > NOISE_RISE_DB:
        return failed(
            what, f"the noise is {more_db:.0f} dB stronger than in past flights", LEVEL_REMEDY
        )
    if more_db < -NOISE_LESS_DB:
        return failed(
            what,
            f"the noise is {-more_db:.0f} dB weaker than in past flights",
            "Check the antenna and its cable, and that the gain is the same as in past flights",
        )
    return passed(what, f"{even}; it differs from past flights by {abs(more_db):.0f} dB")


def _time(facts: FlightFacts, bench: Bench) -> Finding:
    what = "time"
    off_s = facts.clock_off_s
    if off_s is not None and abs(off_s) > CLOCK_OFF_S:
        off = rough_duration(off_s)
        return failed(
            what,
            f"the drone's clock is {off} behind this computer's"
            if off_s > 0
            else f"the drone's clock is {off} ahead of this computer's",
            "Set the clock that is wrong; to set the drone's, run there: sudo timedatectl "
            "set-time",
        )
    if facts.time_known or (facts.time_known is None and bench.posed):
        return passed(what, "the autopilot's clock is known")
    waiting = facts.time_known is None and bench.posed is None
    return failed(
        what,
        "the autopilot's clock is unknown until a pulse is detected"
        if waiting
        else "the autopilot's clock is unknown",
        "Switch on a tag and lay it a few metres away"
        if waiting
        else "Check the drone's cable to the autopilot, both wires, and its MAVLink port",
    )


def _poses(facts: FlightFacts) -> Finding:
    what = "poses"
    age_s = facts.pose_age_s
    if age_s is None:
        return failed(
            what, "no position yet", "Put the drone under the open sky and wait for its GPS"
        )
    if age_s > POSE_OLD_S:
        return failed(
            what,
            f"the last position is {age_s:.0f} s old",
            "Check the telemetry radio and the autopilot's stream rates",
        )
    return passed(what, "the drone's positions arrive")


def _tags(facts: FlightFacts, bench: Bench, now_ns: int) -> Finding:
    what = "tags"
    if not facts.tags:
        return failed(what, "no tags in the table", "Enter the tags under Set-up")
    nothing = _Heard()
    heard = [
        (tag, bench.tags.get(tag.tag_id, nothing))
        for tag in facts.tags
        if _age_s(bench.tags.get(tag.tag_id, nothing).pulse_ns, now_ns) <= HEARD_S
    ]
    if not heard:
        return failed(
            what,
            "no tag was detected in the last minute",
            "Put a tag that is switched on a few metres away, and check its frequency and "
            "interval in the list",
        )
    if all(one.clipped for _, one in heard):
        return failed(
            what,
            "the tag's signal is so strong that the radio is overloaded",
            "Put the test tag farther away, or lower the gain under Set-up",
        )
    names = ", ".join(tag.name or str(tag.tag_id) for tag, _ in heard[:3])
    return passed(what, f"{len(heard)} of {len(facts.tags)} detected: {names}")


def _disk(facts: FlightFacts) -> Finding:
    what = "disk"
    free_mb = facts.disk_free_mb
    if free_mb is None:
        return failed(
            what,
            "the drone has not reported its free space",
            "Wait ten seconds for the drone's report",
        )
    if free_mb < facts.disk_needed_mb:
        return failed(
            what,
            f"{free_mb / 1000.0:.1f} GB free on the drone",
            "Fetch the drone's flights, then press Clean logs under Set-up",
        )
    return passed(what, f"{free_mb / 1000.0:.1f} GB free on the drone")


def _battery(facts: FlightFacts) -> Finding:
    what = "battery"
    percent = facts.battery_percent
    if percent is None:
        return failed(
            what,
            "the autopilot does not report the battery's charge",
            "Set up the battery monitor in the autopilot's parameters (BATT_MONITOR, "
            "BAT1_SOURCE)",
        )
    if percent < BATTERY_PERCENT:
        return failed(
            what,
            f"{percent:.0f} % of the charge is left",
            "Charge the battery, or use a charged one",
        )
    if facts.battery_v is None:
        return passed(what, f"{percent:.0f} % of the charge is left")
    return passed(what, f"{percent:.0f} % of the charge is left, {facts.battery_v:.1f} V")


def _age_s(at_ns: int | None, now_ns: int) -> float:
    return inf if at_ns is None else (now_ns - at_ns) / NANOSECONDS_PER_SECOND


def _megahertz(tag: Tag) -> str:
    return f"{tag.frequency_hz / 1e6:.3f}"
