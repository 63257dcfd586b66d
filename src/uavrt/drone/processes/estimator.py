"""The estimator process: computes bearings on the drone, for ground stations with poor links.

The process gets pulses and poses from the supervisor and sends bearings. A bearing summarises
all pulses of a turn, so one received message replaces many lost ones.
"""

import os
from dataclasses import dataclass

from uavrt.core.earth.on_ground import ground_state
from uavrt.core.errors import UsageError
from uavrt.core.log import get_logger
from uavrt.core.messages import FlightInfo, Health, LiveBearing, Poses, PulsePose
from uavrt.core.units import ns_from_s
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.localization.estimates.live_bearings import LiveBearings

log = get_logger()

NICENESS = 10
"""Scheduling priority below that of the detectors (Unix niceness)."""
TICK_S = 0.2
REPEATS_NS = tuple(ns_from_s(s) for s in (2.0, 4.0, 8.0, 16.0, 32.0))
"""Times between the repeated transmissions of a turn's last bearing [ns]. With 50 % packet
loss, one of the six copies arrives with probability 0.98."""
PERIOD_NS = ns_from_s(0.25)
"""Shortest time between two bearing messages [ns]; their 64 bytes each take a fifth of the
slowest link."""
SHARE = 9
"""Pause after computing bearings, as a multiple of the computing time; limits the load to 0.1
cores."""


@dataclass(slots=True)
class _Waiting:
    bearing: LiveBearing
    due_ns: int
    sent: int = 0


class Outgoing:
    """Queue of bearings to send: for each tag and turn the newest bearing, with repeats."""

    def __init__(self) -> None:
        self._waiting: dict[tuple[int, int], _Waiting] = {}
        self._next_ns = 0

    def __len__(self) -> int:
        return sum(not one.sent for one in self._waiting.values())

    def put(self, bearing: LiveBearing, now_ns: int) -> None:
        """Add a bearing; it replaces an older one of the same tag and turn."""
        key = (bearing.tag_id, bearing.start_time_ns)
        before = self._waiting.get(key)
        # A waiting bearing keeps its place, so that each of a hundred tags gets its turn.
        due_ns = before.due_ns if before is not None and not before.sent else now_ns
        self._waiting[key] = _Waiting(bearing, due_ns)

    def next_due(self, now_ns: int) -> LiveBearing | None:
        """Return the bearing to send now; None if none is due."""
        if now_ns < self._next_ns or not self._waiting:
            return None
        key, first = min(self._waiting.items(), key=lambda item: item[1].due_ns)
        if first.due_ns > now_ns:
            return None
        self._next_ns = now_ns + PERIOD_NS
        if first.sent < len(REPEATS_NS):
            first.due_ns = now_ns + REPEATS_NS[first.sent]
            first.sent += 1
        else:
            del self._waiting[key]
        return first.bearing

    def clear(self) -> None:
        """Remove all bearings, because a new flight begins."""
        self._waiting.clear()


class Estimation:
    """Computes bearings from the received pulses, and sends them when due."""

    def __init__(self, frame: ProcessFrame) -> None:
        self._frame = frame
        flight = frame.assignment.flight
        self._stage = LiveBearings(
            frame.assignment.settings.bearings.antenna, flight.tags if flight else ()
        )
        self._outgoing = Outgoing()
        self._new = False
        self._next_ns = 0
        self.made = self.sent = 0

    def receive(self, topic: str, record: object) -> None:
        """Handle a pulse, poses, the connection's health or a flight from the supervisor."""
        match record:
            case PulsePose():
                self._stage.add_pulse(record)
                self._new = True
            case Poses():
                self._stage.add_poses(record.poses)
            case Health(process="connection"):
                self._stage.add_state(record.time_ns, *ground_state(record))
            case FlightInfo() if topic == "flight":
                self._stage.begin(record.tags)
                self._outgoing.clear()
                self._next_ns = 0  # by another clock

    def tick(self) -> None:
        """Compute bearings if there are new pulses, and send the bearing that is due."""
        now_ns = self._frame.clock.now_ns()
        if self._new and now_ns >= self._next_ns:
            self._new = False
            changed = self._stage.changed()
            took_ns = self._frame.clock.now_ns() - now_ns
            self._next_ns = now_ns + took_ns * (1 + SHARE)
            self.made += len(changed)
            for bearing in changed:
                self._outgoing.put(bearing, now_ns)
        due = self._outgoing.next_due(now_ns)
        if due is not None:
            self.sent += 1
            self._frame.send("bearing", due)

    def counters(self) -> dict[str, float]:
        """Numbers of bearings made, sent and waiting, for the health report."""
        return {
            "bearings_made": self.made,
            "bearings_sent": self.sent,
            "bearings_to_send": len(self._outgoing),
        }


def main() -> None:
    """Estimate bearings until stopped."""
    os.nice(NICENESS)
    with ProcessFrame.start() as frame:
        try:
            estimation = Estimation(frame)
        except UsageError as error:
            log.error("no bearings are computed in this flight", reason=str(error))
            frame.notify(4, f"no bearings on the drone: {error.message}")
            frame.idle(error.message)
            return
        while frame.running:
            for topic, record in frame.receive(timeout_s=TICK_S):
                estimation.receive(topic, record)
            estimation.tick()
            frame.report("ready", counters=estimation.counters)


if __name__ == "__main__":
    main()
