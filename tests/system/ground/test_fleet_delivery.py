"""Five drones deliver to one ground station, each over a link that loses a fifth both ways."""

import random
import socket
import threading
import time
from pathlib import Path
from typing import Any

from tests.system.ground.test_session import SECOND_NS, pulse_at, until

from uavrt.mavlink import FrameParser, FrameWriter, Message, PacedQueue, Priority, dialect
from uavrt.mavlink.pacing import Tunnelled
from uavrt.messages import SystemState
from uavrt.recording import read_flight
from uavrt.tunnel import (
    PAYLOAD_TYPE,
    RECEIPT_TYPE,
    Receipt,
    ReliableSender,
    heartbeat_to_wire,
    pulse_to_wire,
)

VEHICLES, PULSES, PULSES_HZ, LOSS = 5, 64, 8.0, 0.2
GROUND = (255, 190)


class Deliverer:
    """A drone with the real sender on a lossy link, in a thread of its own."""

    def __init__(self, system: int, port: int) -> None:
        self._random = random.Random(system)
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.connect(("127.0.0.1", port))
        self._sock.settimeout(0.004)
        self._writer, self._parser = FrameWriter(system, 191), FrameParser()
        self._payloads: list[bytes] = []
        self.sender: ReliableSender[int] = ReliableSender(lambda at: self._payloads[at])
        self._queue = PacedQueue()
        self._queue.add_source(self.sender, Priority.PULSE)
        self.lost = 0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._fly)

    def start(self) -> None:
        """Hear pulses, and send them."""
        self._thread.start()

    def stop(self) -> None:
        """Land."""
        self._over.set()
        if self._thread.ident is not None:
            self._thread.join(10.0)
        self._sock.close()

    def beat(self) -> None:
        """Tell what it does; this gets through."""
        beat = dialect.Heartbeat(
            type=18,
            autopilot=8,
            base_mode=0,
            custom_mode=0,
            system_status=4,
            mavlink_version=3,
        )
        self._sock.send(self._writer.encode(beat))
        self._tunnel(heartbeat_to_wire(SystemState.DETECTING, 51.5).encode(), PAYLOAD_TYPE)

    def _fly(self) -> None:
        start_ns = last_beat_ns = time.time_ns()
        self.sender.station_present(True, start_ns)
        while not self._over.is_set():
            now_ns = time.time_ns()
            due = min(PULSES, int((now_ns - start_ns) * PULSES_HZ / SECOND_NS))
            for at in range(len(self._payloads), due):
                at_ns = start_ns + int(at * SECOND_NS / PULSES_HZ)
                self._payloads.append(pulse_to_wire(pulse_at(at_ns, 20.0)).encode())
                self.sender.add((2, at), at)
            if now_ns - last_beat_ns > SECOND_NS:
                last_beat_ns = now_ns
                self.beat()
            self.sender.station_present(True, now_ns)
            while (item := self._queue.take(now_ns)) is not None:
                assert isinstance(item, Tunnelled)
                if not self._loses():
                    self._tunnel(item.payload, PAYLOAD_TYPE)
            self._listen()

    def _listen(self) -> None:
        try:
            raw = self._sock.recv(2048)
        except TimeoutError:
            return
        for frame in [] if self._loses() else self._parser.feed(raw):
            message = frame.message()
            if isinstance(message, dialect.Tunnel) and message.payload_type == RECEIPT_TYPE:
                told = Receipt.decode(message.payload[: message.payload_length])
                self.sender.receipt(told.store, told.hashes, GROUND, time.time_ns())

    def _loses(self) -> bool:
        lost = self._random.random() < LOSS
        self.lost += lost
        return lost

    def _tunnel(self, payload: bytes, payload_type: int) -> None:
        message: Message = dialect.Tunnel(
            target_system=254,
            target_component=190,
            payload_type=payload_type,
            payload_length=len(payload),
            payload=payload,
        )
        self._sock.send(self._writer.encode(message))


def test_no_pulse_of_five_drones_is_missing_at_20_percent_loss_on_each_link(
    tmp_path: Path, serve: Any
) -> None:
    numbers = range(1, VEHICLES + 1)
    station = serve(tmp_path / "ground", page={"further_vehicles": tuple(numbers)[1:]})
    drones = {number: Deliverer(number, station.mavlink_port) for number in numbers}
    try:
        drones[1].beat()
        until(station, lambda state: state["drone"]["system_id"] == 1)
        for drone in drones.values():
            drone.start()

        def arrived(_: Any) -> bool:
            told = station.ask("GET", "/api/flights").json
            return sorted(one["pulses"] for one in told) == [PULSES] * VEHICLES

        until(station, arrived)
        told = station.ask("GET", "/api/flights").json
        starts = {
            one["vehicle"]: {
                pulse.pulse.start_time_ns
                for pulse in read_flight(station.directory / one["flight_id"]).pulse_poses
            }
            for one in told
        }
        assert set(starts) == {str(number) for number in numbers}
        assert all(len(one) == PULSES for one in starts.values())
        assert all(drone.lost > 0.1 * PULSES for drone in drones.values())
    finally:
        for drone in drones.values():
            drone.stop()
        station.stop()
