"""Latest reports of one vehicle's drone, and the tags that it holds. Pure."""

from collections.abc import Iterable

from uavrt.clock import monotonic_s
from uavrt.commands import SystemState
from uavrt.computer.bench import Bench
from uavrt.config.tag_corrections import TagCorrection, still_holds
from uavrt.ground.link.clock_skew import ClockSkew
from uavrt.ground.link.protocol import DroneHeartbeat
from uavrt.messages import Beep, LiveBearing, PulsePose, Tag, drop_beeps, keep_beep


class DroneReports:
    """The drone's latest reports; its silence begins at `now_ns`."""

    def __init__(self, now_ns: int) -> None:
        self.state: SystemState | None = None
        self.temperature_c: float | None = None
        self.directory = ""
        """Directory of the flight on the drone; empty: unknown."""
        self.sent_tags: tuple[Tag, ...] = ()
        self.heard: dict[int, int] = {}
        """Time of the last report of each tag's detector [ns]."""
        self.beeps: list[Beep] = []
        """Latest measurement of each sender of pulses in the flight."""
        self.bearings: dict[tuple[int, int], LiveBearing] = {}
        self.last_pulse_s = 0.0
        self.bench = Bench()
        self.contact_ns = now_ns
        self._skew = ClockSkew()
        self._present = False

    @property
    def skew_ns(self) -> int | None:
        """Delay of the drone's clock behind ours [ns]; None while unknown."""
        return self._skew.skew_ns

    def take_heartbeat(self, heartbeat: DroneHeartbeat) -> SystemState | None:
        """Store the drone's state; return the previous one."""
        before, self.state = self.state, heartbeat.state
        self.temperature_c = heartbeat.cpu_temperature_c
        return before

    def take_pulse(self, event: PulsePose, now_ns: int) -> str | None:
        """Add the time of a pulse; return a text when the drone's clock is found to differ."""
        self.heard[event.pulse.tag_id] = now_ns
        self.last_pulse_s = monotonic_s()
        return self._skew.learn(now_ns - event.pulse.end_time_ns)

    def take_beep(self, beep: Beep, corrections: Iterable[TagCorrection]) -> bool:
        """Store a measured sender; False if it is known, or older than its tag's correction."""
        if beep in self.beeps or self._is_outdated(beep, corrections):
            return False
        keep_beep(self.beeps, beep)
        drop_beeps(self.beeps)
        return True

    def _is_outdated(self, beep: Beep, corrections: Iterable[TagCorrection]) -> bool:
        """True if a sender was measured before this station corrected its tag."""
        return not still_holds(beep, self.sent_tags) and any(
            one.tag_id in beep.tag_ids and still_holds(beep, (one.before,))
            for one in corrections
        )

    def take_presence(self, present: bool, now_ns: int) -> bool:
        """Set whether there is contact; return whether that has changed."""
        changed, self._present = present != self._present, present
        if present:
            self.contact_ns = now_ns
        elif changed:
            self.state = None
        return changed

    def disconnected(self) -> None:
        """Clear the state: the link is closed."""
        self.state = None
        self._present = False

    def recall(self, beeps: Iterable[Beep]) -> None:
        """Add senders that were measured before this program started."""
        self.beeps += beeps
        drop_beeps(self.beeps)

    def begin_flight(self) -> None:
        """Clear the reports of the previous flight."""
        self.heard.clear()
        self.bearings.clear()
        self.beeps.clear()

    def forget(self) -> None:
        """Clear everything: another vehicle is served."""
        self.state, self.temperature_c, self.directory = None, None, ""
        self.sent_tags = ()
        self.bench.reset()

    def set_tags(self, tags: tuple[Tag, ...]) -> None:
        """Set the tags that the drone holds."""
        self.sent_tags = tags

    def tags_accepted(self, tags: tuple[Tag, ...]) -> None:
        """Set the tags that are valid now; the heartbeat that reports it may come 1 s later."""
        self.sent_tags = tags
        if self.state is not None:
            self.state = SystemState.HAS_TAGS

    def started(self, directory: str) -> None:
        """Set the directory of the flight on the drone."""
        self.directory = directory
