"""The session against a drone that speaks real MAVLink frames over UDP."""

import contextlib
import json
import os
import socket
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from command_line import launched
from past_flight import write_flight
from pulses import pulse_at as heard_pulse
from sql import sql
from until import until as wait_until

from uavrt.core.commands import SystemState
from uavrt.core.messages import PulsePose
from uavrt.flight.reading.noted_places import vehicle_note
from uavrt.flight.reading.quiet_noise import read_quiet_noise_db
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.link.tunnel.generations.wire import PAYLOAD_TYPE
from uavrt.link.tunnel.own_messages.burst import BURST_TYPE, encode_burst
from uavrt.link.tunnel.tunnel_records import heartbeat_to_wire, pulse_to_wire
from uavrt.simulation.demo.demo_programs import free_udp_port

SECOND_NS = 1_000_000_000


class Drone:
    """Component 191, as far as a ground station hears it."""

    def __init__(self, port: int, system: int = 1) -> None:
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.connect(("127.0.0.1", port))
        self._writer = FrameWriter(system, 191)

    def send(self, message: Message) -> None:
        self._sock.send(self._writer.encode(message))

    def tunnel(self, payload: bytes, payload_type: int = PAYLOAD_TYPE) -> None:
        self.send(made.tunnel(payload_type, payload))

    def heartbeat(self, state: SystemState) -> None:
        self.send(made.heartbeat())
        self.tunnel(heartbeat_to_wire(state, 51.5).encode())

    def pulse(self, start_ns: int, snr_db: float = 20.0, noise_psd: float = 1e-9) -> None:
        self.tunnel(pulse_to_wire(pulse_at(start_ns, snr_db, noise_psd)).encode())

    def close(self) -> None:
        self._sock.close()


def pulse_at(start_ns: int, snr_db: float, noise_psd: float = 1e-9) -> PulsePose:
    pulse = heard_pulse(start_ns, frequency_hz=148.7e6, snr_db=snr_db, noise_psd=noise_psd)
    pose = made.pose(start_ns, 46.5, 8.0)
    return PulsePose(pulse=replace(pulse), pose=pose)


@pytest.fixture
def drone(served: Any) -> Iterator[Drone]:
    drone = Drone(served.mavlink_port)
    yield drone
    drone.close()


def until(served: Any, what: Any, path: str = "/api/state") -> dict[str, Any]:
    """The state, once something holds."""
    states: list[dict[str, Any]] = []

    def so() -> bool:
        states[:] = [served.ask("GET", path).json]
        return bool(what(states[0]))

    wait_until(so)
    return states[0]


def test_the_noise_of_one_tag_is_judged_by_past_flights(served: Any, drone: Drone) -> None:
    row = {"id": 2, "frequency_mhz": 148.7, "interval_ms": 1200, "pulse_width_ms": 20}
    row |= {"interval_uncertainty_ms": 20, "interval_jitter_ms": 20, "k": 3}
    assert served.ask("PUT", "/api/tags", [row]).status == 200

    def noise(noise_psd: float, text: str) -> dict[str, Any]:
        def told() -> list[dict[str, Any]]:
            drone.heartbeat(SystemState.DETECTING)
            drone.pulse(time.time_ns() - SECOND_NS, noise_psd=noise_psd)
            found = served.ask("GET", "/api/first-flight").json
            return [one for one in found if one["what"] == "noise" and text in one["text"]]

        return wait_until(told)[0]

    first = noise(1e-3, "there is no past flight")
    assert (first["ok"], first["open"]) == (False, True)
    # The station's own flight has its directory: another of this second is named differently.
    until(served, lambda _: list(served.directory.glob("*/flight.sqlite")))
    past = write_flight(served.directory, 120.0, 300.0)
    assert read_quiet_noise_db(served.directory / past) == pytest.approx(-90.0)
    loud = noise(1e-3, "60 dB stronger than in past flights")
    assert (loud["ok"], loud["open"]) == (False, False)
    # Of another vehicle nobody knows what is normal for this one.
    note = "INSERT INTO notes VALUES (1, ?)"
    sql(served.directory / past, note, values=[vehicle_note(7, "kite")])
    noise(1e-3, "there is no past flight")


def test_a_bursts_inside_that_is_broken_or_of_no_burst_is_counted(
    served: Any, drone: Drone
) -> None:
    drone.heartbeat(SystemState.DETECTING)
    # A time that the wire's seconds hold exactly, as the key of a pulse must be.
    start_ns = (time.time_ns() // SECOND_NS - 1) * SECOND_NS
    starts_ns = tuple(start_ns + ms * 1_000_000 for ms in (0, 25, 80, 111))
    burst = replace(
        pulse_at(start_ns, 20.0).pulse,
        burst_starts_ns=starts_ns,
        burst_snrs_db=(20.0, 20.5, 19.5, 20.0),
        also_possible_tag_ids=(4,),
    )
    inside = encode_burst(burst)
    assert inside is not None
    drone.pulse(start_ns)
    for payload in (inside, inside, inside[:-1], b"\x01\xff" + inside[2:]):
        drone.tunnel(payload, BURST_TYPE)
    other = encode_burst(replace(burst, start_time_ns=start_ns + SECOND_NS))
    drone.tunnel(other or b"", BURST_TYPE)  # of a burst that is not here
    until(served, lambda state: state["link"]["counters"].get("not_stored") == 1)
    state = until(served, lambda state: state["link"]["counters"].get("bad_payloads") == 2)
    assert state["link"]["counters"]["repeated_pulses"] == 1


def test_a_receiver_tells_this_computers_place_and_noise_does_not(served: Any) -> None:
    port = free_udp_port()
    told = served.ask("PUT", "/api/settings", {"my_place": f"udpin://127.0.0.1:{port}"})
    assert told.json["my_place"] == f"udpin://127.0.0.1:{port}"
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.connect(("127.0.0.1", port))

    def tell(sentence: bytes) -> Any:
        def told(state: dict[str, Any]) -> bool:
            with contextlib.suppress(ConnectionRefusedError):  # not listening yet
                receiver.send(os.urandom(200) + b"\n" + sentence + b"\r\n")
            me = state["me"] or {}
            return bool(me.get("refused") or me.get("sentences"))

        return told

    wrong = b"$GPRMC,101500,A,4700.06,N,00800.12,E,0.1,0.0,010526,,*11"
    state = until(served, tell(wrong))
    assert state["me"]["latitude_deg"] is None
    right = b"$GPRMC,101500,A,4630.06,N,00800.12,E,0.1,0.0,010526,,*15"
    until(served, tell(right))
    state = until(served, lambda state: state["me"]["latitude_deg"] is not None)
    assert state["me"]["latitude_deg"] == pytest.approx(46.501)
    assert state["me"]["longitude_deg"] == pytest.approx(8.002)
    served.ask("PUT", "/api/settings", {"my_place": ""})
    until(served, lambda state: state["me"] is None)
    receiver.close()
    assert served.ask("PUT", "/api/settings", {"my_place": "gpsd"}).status == 422


def test_pulses_are_kept_when_nobody_reads_the_terminal_any_more(tmp_path: Path) -> None:
    port = free_udp_port()
    station = launched(
        *("-m", "uavrt.cli", "ground", "--no-browser", "--port", "0"),
        *("-o", tmp_path, "--mavlink", f"udpin://127.0.0.1:{port}"),
    )
    assert station.stdout is not None
    address = station.stdout.readline().split()[4]
    station.stdout.close()
    drone = Drone(port)
    drone.heartbeat(SystemState.DETECTING)
    start_ns = time.time_ns() - SECOND_NS
    for place in range(20):
        drone.pulse(start_ns + place * SECOND_NS // 100)
        time.sleep(0.02)

    def pulses() -> int:
        with urllib.request.urlopen(f"{address}api/state", timeout=60) as answer:
            return int(json.load(answer)["flight"]["pulses"])

    wait_until(lambda: pulses() == 20)
    station.terminate()
    assert station.wait(60.0) == 0
    drone.close()
