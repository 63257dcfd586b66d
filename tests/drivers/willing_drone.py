"""A drone that does what it is told: it acknowledges, and tells its state and place."""

import contextlib
import socket
import threading
import time
from dataclasses import replace

from uavrt.mavlink import dialect
from uavrt.mavlink.frame import FrameParser, FrameWriter
from uavrt.messages import Course, Neighbour, SystemState
from uavrt.tunnel import (
    COURSE_TYPE,
    MOTION_STATE_TYPE,
    NEIGHBOUR_TYPE,
    PAYLOAD_TYPE,
    AckG1,
    MotionState,
    acked_command_of,
    decode_neighbour,
    encode_course,
    encode_state,
)
from uavrt.tunnel.convert import heartbeat_to_wire
from uavrt.tunnel.wire import CommandId

AFTER = {
    CommandId.START_TAGS: SystemState.RECEIVING_TAGS,
    CommandId.END_TAGS: SystemState.HAS_TAGS,
    CommandId.START_DETECTION: SystemState.DETECTING,
    CommandId.STOP_DETECTION: SystemState.HAS_TAGS,
}


class WillingDrone:
    """Component 191 and its autopilot, on a socket."""

    def __init__(self, port: int, system_id: int = 1) -> None:
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.connect(("127.0.0.1", port))
        self._sock.settimeout(0.02)
        self._parser = FrameParser()
        self._system_id = system_id
        self._companion = FrameWriter(system_id, 191)
        self._autopilot = FrameWriter(system_id, 1)
        self._ending = threading.Event()
        self.state = SystemState.IDLE
        self.tags = 0
        """Of the last list."""
        self.silent = False
        self.course: Course | None = None
        """What it says of itself, with its standing in motion."""
        self.told: list[Neighbour] = []
        self._beats = 0
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        next_s = 0.0
        while not self._ending.is_set():
            if time.monotonic() >= next_s and not self.silent:
                next_s = time.monotonic() + 0.3
                self._beat()
            try:
                frames = self._parser.feed(self._sock.recv(4096))
            except OSError:
                continue
            for frame in frames:
                message = frame.message()
                if not isinstance(message, dialect.Tunnel) or self.silent:
                    continue
                if message.target_system not in (0, self._system_id):
                    continue
                payload = bytes(message.payload[: message.payload_length])
                if message.payload_type == NEIGHBOUR_TYPE:
                    self.told.append(decode_neighbour(payload))
                else:
                    self._obey(payload)

    def _beat(self) -> None:
        beat = dialect.Heartbeat(
            type=2, autopilot=12, base_mode=0, custom_mode=0, system_status=4, mavlink_version=3
        )
        place = dialect.GlobalPositionInt(
            time_boot_ms=1,
            lat=465_000_000 + 10_000 * (self._system_id - 1),  # 110 m farther north each
            lon=80_000_000,
            alt=1_000_000,
            relative_alt=40_000,
            vx=0,
            vy=0,
            vz=0,
            hdg=9_000,
        )
        for message in (beat, place):
            self._send(self._autopilot.encode(message))
        self._send(self._companion.encode(beat))
        self._tunnel(heartbeat_to_wire(self.state, 51.5).encode())
        if self.course is not None:
            self._beats += 1
            course = replace(self.course, sequence=self._beats)
            state = MotionState(kind="state", standing="in command", text="searching")
            self._tunnel(encode_state(state), MOTION_STATE_TYPE)
            self._tunnel(encode_course(course), COURSE_TYPE)

    def _obey(self, payload: bytes) -> None:
        command = acked_command_of(payload)
        if command is None or command in (CommandId.ACK, CommandId.PULSE):
            return
        if command == CommandId.START_TAGS:
            self.tags = 0
        self.tags += command == CommandId.TAG
        self.state = AFTER.get(CommandId(command), self.state)
        self._tunnel(AckG1(acked_command=command, result=1, message="").encode())
        self._beat()

    def _tunnel(self, payload: bytes, payload_type: int = PAYLOAD_TYPE) -> None:
        message = dialect.Tunnel(
            target_system=254,
            target_component=190,
            payload_type=payload_type,
            payload_length=len(payload),
            payload=payload,
        )
        self._send(self._companion.encode(message))

    def _send(self, datagram: bytes) -> None:
        with contextlib.suppress(ConnectionRefusedError):  # the station has ended
            self._sock.send(datagram)

    def close(self) -> None:
        """Fall silent."""
        self._ending.set()
        self._thread.join(10.0)
        self._sock.close()
