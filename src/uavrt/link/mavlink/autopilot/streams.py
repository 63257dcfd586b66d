"""Decide which message streams to request from the autopilot, and when; no I/O.

PX4 sends most of these streams without a request, ArduPilot none. Requests are sent one at a
time, because the acknowledgement does not name the requested message. A stream without messages
for 3 s is requested again, so the streams also return after a restart of the autopilot.
"""

from dataclasses import dataclass

from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.dialect import CommandAck, CommandLong, MavCmd, MavResult
from uavrt.link.mavlink.discovery import Peer

ACK_WAIT_NS = ns_from_s(0.5)
SILENCE_NS = ns_from_s(3.0)
MAX_TRIES = 5


@dataclass(slots=True)
class _Stream:
    message_id: int
    interval_us: float
    silence_ns: int
    heard_ns: int = 0
    wanted: bool = True
    tries: int = 0


class StreamRequests:
    """Message streams to request from the autopilot, their rates, and the state of each
    request.
    """

    def __init__(self, rates_hz: dict[int, float]) -> None:
        self._streams = {
            message_id: _Stream(message_id, 1e6 / rate, max(SILENCE_NS, ns_from_s(3 / rate)))
            for message_id, rate in rates_hz.items()
        }
        self._waiting: _Stream | None = None
        self._asked_ns = 0
        self.requests = 0
        self.refusals = 0

    def restart(self, now_ns: int) -> None:
        """Request everything again: the autopilot is new or was restarted."""
        self._waiting = None
        for stream in self._streams.values():
            stream.wanted, stream.tries, stream.heard_ns = True, 0, now_ns

    def received(self, message_id: int, now_ns: int) -> None:
        """Record that a requested message has arrived."""
        stream = self._streams.get(message_id)
        if stream is not None:
            stream.heard_ns = now_ns

    def acknowledged(self, ack: CommandAck) -> None:
        """Handle the autopilot's acknowledgement of a stream request."""
        if ack.command != MavCmd.SET_MESSAGE_INTERVAL or self._waiting is None:
            return
        if ack.result == MavResult.IN_PROGRESS:
            return
        if ack.result == MavResult.ACCEPTED:
            self._waiting.wanted = False
        elif ack.result != MavResult.TEMPORARILY_REJECTED:
            self._waiting.wanted = False
            self.refusals += 1
        self._waiting = None

    def next_request(self, autopilot: Peer, now_ns: int) -> CommandLong | None:
        """Return the stream request to send now; None if none is due."""
        if self._waiting is not None:
            if now_ns - self._asked_ns < ACK_WAIT_NS:
                return None
            if self._waiting.tries >= MAX_TRIES:
                self._waiting.wanted, self._waiting.heard_ns = False, now_ns
            self._waiting = None
        for stream in self._streams.values():
            if not stream.wanted and now_ns - stream.heard_ns > stream.silence_ns:
                stream.wanted, stream.tries, stream.heard_ns = True, 0, now_ns
        wanted = [stream for stream in self._streams.values() if stream.wanted]
        if not wanted:
            return None
        stream = min(wanted, key=lambda stream: stream.tries)
        self._waiting, self._asked_ns = stream, now_ns
        self.requests += 1
        stream.tries += 1
        return CommandLong(
            **autopilot.address,
            command=MavCmd.SET_MESSAGE_INTERVAL,
            confirmation=min(255, stream.tries - 1),
            param1=float(stream.message_id),
            param2=stream.interval_us,
        )
