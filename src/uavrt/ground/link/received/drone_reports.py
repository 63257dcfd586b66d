"""Latest reports of one vehicle's drone, and the tags stored on it. No I/O."""

from collections.abc import Iterable

from uavrt.config.tags.tag_corrections import TagCorrection, still_holds
from uavrt.core.clock import monotonic_s
from uavrt.core.commands import SystemState
from uavrt.core.messages import Beep, LiveBearing, PulsePose, Tag, drop_beeps, keep_beep
from uavrt.drone.computer.bench import Bench
from uavrt.ground.link.protocol import DroneHeartbeat
from uavrt.ground.link.received.clock_skew import ClockSkew


class DroneReports:
    """Latest reports of a drone.

    `now_ns`: time from which the time without contact is counted.
    """

    def __init__(self, now_ns: int) -> None:
        self.state: SystemState | None = None
        self.temperature_c: float | None = None
        self.directory = ""
        """Flight directory on the drone; empty while unknown."""
        self.sent_tags: tuple[Tag, ...] = ()
        self.heard: dict[int, int] = {}
        """Time of the last report from each tag's detector [ns]."""
        self.beeps: list[Beep] = []
        """Latest measurement of each pulse train in this flight, of listed or unknown tags."""
        self.bearings: dict[tuple[int, int], LiveBearing] = {}
        self.last_pulse_s = 0.0
        self.bench = Bench()
        self.contact_ns = now_ns
        self._skew = ClockSkew()
        self._present = False

    @property
    def skew_ns(self) -> int | None:
        """Time by which the drone's clock is behind ours [ns]; None while unknown."""
        return self._skew.skew_ns

    def receive_heartbeat(self, heartbeat: DroneHeartbeat) -> SystemState | None:
        """Store the state that the drone reports; return the previous one, None if unknown."""
        before, self.state = self.state, heartbeat.state
        self.temperature_c = heartbeat.cpu_temperature_c
        return before

    def receive_pulse(self, event: PulsePose, now_ns: int) -> str | None:
        """Add the time of a pulse; return a message at the first clock offset, else None."""
        self.heard[event.pulse.tag_id] = now_ns
        self.last_pulse_s = monotonic_s()
        return self._skew.learn(now_ns - event.pulse.end_time_ns)

    def receive_beep(self, beep: Beep, corrections: Iterable[TagCorrection]) -> bool:
        """Store a measured pulse train; False if it is a repetition or outdated."""
        if beep in self.beeps or self._is_outdated(beep, corrections):
            return False
        keep_beep(self.beeps, beep)
        drop_beeps(self.beeps)
        return True

    def _is_outdated(self, beep: Beep, corrections: Iterable[TagCorrection]) -> bool:
        """True if a pulse train was measured before this station corrected the tag's list
        entry.
        """
        return not still_holds(beep, self.sent_tags) and any(
            one.tag_id in beep.tag_ids and still_holds(beep, (one.before,))
            for one in corrections
        )

    def set_presence(self, present: bool, now_ns: int) -> bool:
        """Record whether the drone is in contact; return True if this has changed."""
        changed, self._present = present != self._present, present
        if present:
            self.contact_ns = now_ns
        elif changed:
            self.state = None
        return changed

    def disconnected(self) -> None:
        """Clear the drone's state, because the link is closed."""
        self.state = None
        self._present = False

    def recall(self, beeps: Iterable[Beep]) -> None:
        """Add pulse trains that were measured before this program was started."""
        self.beeps += beeps
        drop_beeps(self.beeps)

    def begin_flight(self) -> None:
        """Clear the reports of the previous flight."""
        self.heard.clear()
        self.bearings.clear()
        self.beeps.clear()

    def forget(self) -> None:
        """Clear all reports, because another vehicle is served."""
        self.state, self.temperature_c, self.directory = None, None, ""
        self.sent_tags = ()
        self.bench.reset()

    def set_tags(self, tags: tuple[Tag, ...]) -> None:
        """Set the tags that are stored on the drone."""
        self.sent_tags = tags

    def tags_accepted(self, tags: tuple[Tag, ...]) -> None:
        """Set the tags that the drone just accepted, before a heartbeat reports them."""
        self.sent_tags = tags
        if self.state is not None:
            self.state = SystemState.HAS_TAGS

    def started(self, directory: str) -> None:
        """Record the directory of the flight that the drone has started."""
        self.directory = directory
