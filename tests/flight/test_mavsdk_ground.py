"""A ground station that nobody here wrote flies the drone side: MAVSDK."""

import json
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import mavsdk
import pytest
from mavsdk.plugins.mavlink_direct import MavlinkDirect, MavlinkMessage

THESIS_TAG_G0 = bytes.fromhex(  # golden
    "04000000020000007022dd0814000000e6040000000000003c0000000a00000003000000000000007b14ae47"
    "e17a743f"
)
THESIS_TAG_G1 = struct.pack(
    "<9I4xdII4d", 4, 2, 148_710_000, 20, 1254, 0, 60, 10, 3, 0.005, 0, 0, *[float("nan")] * 4
)
START_TAGS, END_TAGS = struct.pack("<I", 2), struct.pack("<I", 3)
START_G0, STOP = struct.pack("<I", 5), struct.pack("<I", 6)
START_G1 = struct.pack("<IIIIddI4x", 5, 0, 0, 0, 0.0, 0.0, 0)


class MavsdkGround:
    """Sends and receives TUNNEL by MAVSDK's `mavlink_direct`."""

    def __init__(self, direct: MavlinkDirect) -> None:
        self._direct = direct
        self.payloads: list[bytes] = []
        direct.subscribe_message("TUNNEL", self._take)

    def _take(self, message: Any, *_: Any) -> None:
        fields = json.loads(message.fields_json)
        self.payloads.append(bytes(fields["payload"][: fields["payload_length"]]))

    def command(self, payload: bytes) -> bytes:
        """Send a command until it is acknowledged; get the acknowledgement."""
        number = payload[0]
        fields = {
            "target_system": 1,
            "target_component": 191,
            "payload_type": 0,
            "payload_length": len(payload),
            "payload": list(payload.ljust(128, b"\0")),
        }
        message = MavlinkMessage("TUNNEL", 0, 0, 1, 191, json.dumps(fields))
        for _ in range(5):
            seen = len(self.payloads)
            self._direct.send_message(message)
            acks = wait_for(
                lambda seen=seen: [  # type: ignore[misc]
                    p for p in self.payloads[seen:] if p[0] == 1 and p[4] == number
                ],
                3.0,
            )
            if acks:
                return bytes(acks[0])
        raise AssertionError(f"command {number} was not acknowledged")

    def pulses(self, size: int) -> list[bytes]:
        """Pulses of a struct size, detector heartbeats and search reports left out."""
        status_at = {128: 64, 120: 72}[size]
        pulses = [p for p in self.payloads if p[0] == 7 and len(p) == size]
        # At frequency 0 it is a detector's heartbeat.
        return [p for p in pulses if p[status_at] < 3 and p[8:12] != bytes(4)]


def wait_for(condition: Callable[[], Any], timeout_s: float) -> Any:
    deadline_s = time.monotonic() + timeout_s
    while not (result := condition()) and time.monotonic() < deadline_s:
        time.sleep(0.05)
    return result


@contextmanager
def mavsdk_ground(port: int, system_id: int | None) -> Iterator[MavsdkGround]:
    """A ground station at MAVSDK's default numbers 245/190, or at `system_id`/190."""
    if system_id is None:
        kind = mavsdk.ComponentType.GROUND_STATION
        configuration = mavsdk.Configuration.create_with_component_type(kind)
    else:
        configuration = mavsdk.Configuration.create_manual(system_id, 190, True)
    sdk = mavsdk.Mavsdk(configuration)
    try:
        sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        system = wait_for(lambda: sdk.get_systems(), 20.0)[0]
        yield MavsdkGround(MavlinkDirect(system))
    finally:
        sdk.destroy()


@pytest.mark.timeout(180)
def test_mavsdk_uploads_the_thesis_tag_starts_and_receives_its_pulses(
    drone_bay: Any, thesis_scenario: Any
) -> None:
    drone = drone_bay.launch(thesis_scenario)
    for system_id, tag, start, size in (
        (None, THESIS_TAG_G1, START_G1, 120),
        (255, THESIS_TAG_G0, START_G0, 128),
    ):
        with mavsdk_ground(drone.ground_port, system_id) as ground:
            for payload in (START_TAGS, tag, END_TAGS, start):
                ack = ground.command(payload)
                for _ in range(8):
                    if payload != start or ack[8] == 1:
                        break
                    time.sleep(1.0)  # the flight before has not ended yet: "try again"
                    ack = ground.command(payload)
                assert struct.unpack_from("<III", ack) == (1, payload[0], 1)
                assert len(ack) == (128 if size == 120 or payload in (START_TAGS,) else 12)
            pulses = wait_for(
                lambda ground=ground, size=size: (  # type: ignore[misc]
                    len(ground.pulses(size)) >= 6 and ground.pulses(size)
                ),
                40.0,
            )
            assert pulses
            starts = sorted(struct.unpack_from("<d", p, 16)[0] for p in pulses)
            for pulse in pulses:
                assert struct.unpack_from("<II", pulse, 4)[0] == 2
                assert abs(struct.unpack_from("<I", pulse, 8)[0] - 148_710_000) < 100
            gaps = [later - earlier for earlier, later in pairwise(starts)]
            assert all(abs(gap / 1.254 - round(gap / 1.254)) < 0.02 for gap in gaps)
            assert struct.unpack_from("<III", ground.command(STOP)) == (1, 6, 1)
            time.sleep(3.0)
