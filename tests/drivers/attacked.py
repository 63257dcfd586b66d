"""A keyed drone that flies orders behind its real connection process, and who attacks its link.

The test stands in the supervisor's and the guide's place. The attacker overhears everything,
chooses ids as it likes, and has no key.
"""

import random
import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import made

from uavrt.config.settings import GuidanceSettings
from uavrt.core.messages import MotionOffer, MotionRequest, VehicleReport, VehicleRequest
from uavrt.guidance.autopilot_behaviour import behaviour_of
from uavrt.guidance.operator_orders import Limits, Order
from uavrt.guidance.order_execution import OrderExecution
from uavrt.guidance.plans import plan_of
from uavrt.guidance.vehicle_reports import now_of
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.link.mavlink.links.udp import MAX_PEERS
from uavrt.link.mavlink.message import Message
from uavrt.link.tunnel.own_messages.motion_messages import (
    MotionConfirmation,
    MotionState,
    MotionStop,
    encode_confirmation,
    encode_state,
    encode_stop,
)
from uavrt.link.tunnel.own_messages.private import (
    MOTION_STATE_TYPE,
    MOTION_TYPE,
    RECEIPT_TYPE,
    SEALED_TYPE,
    SESSION_TYPE,
    Receipt,
)

DRONE, CONFIRMER = (1, 191), (254, 190)
NONCE = 0x1234_5678_9ABC
BATCH_S = 0.002
PORTS = MAX_PEERS + 6
"""Ports that an attacker sends from: more than a link keeps."""
SECRET = bytes(range(32))


def key_file(directory: Path) -> Path:
    path = directory / "command.key"
    path.write_text(SECRET.hex())
    path.chmod(0o600)
    return path


class Guided:
    """Makes a bay's drone one with a key that offers orders, and flies what is confirmed.

    `bay`: not yet running.
    `key`: file of the drone's key.
    `**mavlink`: further settings.
    """

    def __init__(self, bay: Any, key: Path | None, **mavlink: Any) -> None:
        self.bay = bay
        settings = bay.settings
        guidance = GuidanceSettings(enabled=True, battery_wh=120.0, link_lost="hold")
        path = None if key is None else str(key)
        bay.settings = replace(
            settings,
            guidance=guidance,
            mavlink=replace(settings.mavlink, key_file=path, **mavlink),
        )
        bay.assignment = replace(bay.assignment, settings=bay.settings)
        bay.autopilot_settings = replace(bay.autopilot_settings, flies=True, sticks=True)
        self.report: VehicleReport | None = None
        self.execution: OrderExecution | None = None
        self.out_s: float | None = None
        """When our say ended last."""
        self.lost_s: float | None = None
        """When the pilot noticed that the link was lost."""
        self.order_id = 0
        self._offered: OrderExecution | None = None
        take = bay._take

        def taken(topic: str, record: object) -> None:
            take(topic, record)
            bay.records.clear()
            if isinstance(record, MotionRequest):
                self._offer(record)
            if isinstance(record, VehicleReport):
                self._fly(record)

        bay._take = taken

    @property
    def standing(self) -> str:
        """``"out"``, ``"confirmed"`` or ``"in command"``."""
        return "out" if self.report is None else self.report.standing

    def _now_s(self) -> float:
        return float(self.bay.clock.now_ns()) / 1e9

    def _offer(self, request: MotionRequest) -> None:
        assert self.report is not None
        now = now_of(self.report, self._now_s())
        assert now is not None
        self.order_id += 1
        order = Order(order_id=self.order_id, action="goto", places=request.places)
        limits = Limits(battery_wh=120.0)
        plan = plan_of(order, now, limits, behaviour_of(self.report.autopilot))
        self._offered = OrderExecution(order, plan, limits)
        offer = MotionOffer(
            request_id=request.request_id,
            requester=request.requester,
            order_id=self.order_id,
            nonce=NONCE + self.order_id,
            summary=plan.summary,
            mode=self.report.mode,
        )
        self.bay.deliver("motion_offer", offer)

    def _fly(self, report: VehicleReport) -> None:
        if self.standing != "out" and report.standing == "out":
            self.out_s = self._now_s()
        self.report = report
        now = now_of(report, self._now_s())
        if report.order_id is None or now is None:
            self.lost_s = None
            return
        if self.execution is None or self.execution.order.order_id != report.order_id:
            self.execution, self.lost_s = self._offered, None
        assert self.execution is not None
        manoeuvre = self.execution.next(now)
        record = VehicleRequest(order_id=report.order_id)
        if manoeuvre is not None:
            record = VehicleRequest(order_id=report.order_id, manoeuvre=manoeuvre)
        self.bay.deliver("vehicle_request", record)
        if "lost" in self.execution.status_text and self.lost_s is None:
            self.lost_s = self._now_s()


class Attacker:
    """Sends frames to the drone's port, and to the ground's.

    `bay`: that runs.
    `ground`: what it sends is overheard, and can be sent again.
    `yesterday`: announcements of earlier sessions of this drone, with its key.
    """

    def __init__(self, bay: Any, ground: Any, yesterday: tuple[bytes, ...] = ()) -> None:
        self._bay, self._ground, self._yesterday = bay, ground, yesterday
        self._random = random.Random(7)
        self._overheard: list[bytes] = []
        self._frames = self._hostile()
        self._drone = FrameWriter(*DRONE)
        self._batches = 0
        self.sent = 0
        write = ground._links._shared.write

        def overheard(message: Message, number: int) -> None:
            write(message, number)
            if isinstance(message, dialect.Tunnel) and message.payload_type == SEALED_TYPE:
                self._overheard.append(message.payload[: message.payload_length])
                del self._overheard[:-200]

        ground._links._shared.write = overheard

    def __enter__(self) -> "Attacker":
        self._to_drone = [socket.socket(type=socket.SOCK_DGRAM) for _ in range(PORTS)]
        for one in self._to_drone:
            one.connect(("127.0.0.1", self._bay.companion_port))
        self._to_ground = socket.socket(type=socket.SOCK_DGRAM)
        self._to_ground.connect(("127.0.0.1", self._bay.ground_port))
        return self

    def __exit__(self, *_: object) -> None:
        for one in (*self._to_drone, self._to_ground):
            one.close()

    def frame(self) -> bytes:
        """Get the next frame to the drone."""
        self.sent += 1
        return next(self._frames)

    def batch(self, to_drone: int = 4) -> None:
        """Send what comes in 2 ms: four frames to the drone, some to the ground."""
        for _ in range(to_drone):
            self._to_drone[self.sent % PORTS].send(self.frame())
        self._batches += 1
        if self._yesterday and self._batches % 25 == 0:  # 20 a second
            number = self._batches // 25 % len(self._yesterday)
            self._as_drone(SESSION_TYPE, self._yesterday[number])
        if self._batches % 5 == 0:
            for request_id in (*self._ground.protocol.orders,)[-2:]:
                forged = MotionState(
                    kind="state", standing="out", text="stopped", request_id=request_id
                )
                if self._random.random() < 0.5:
                    forged = replace(forged, kind="refused")
                self._as_drone(MOTION_STATE_TYPE, encode_state(forged))

    def _as_drone(self, kind: int, payload: bytes) -> None:
        self._to_ground.send(self._drone.encode(tunnel(kind, payload, CONFIRMER)))

    def _hostile(self) -> Iterator[bytes]:
        pick = self._random
        while True:
            others = (pick.randrange(1, 254), 195)
            place = pick.choice((CONFIRMER, CONFIRMER, (255, 190), others))
            if place[0] == DRONE[0]:
                continue
            yield FrameWriter(*place).encode(self._message(pick))

    def _message(self, pick: random.Random) -> Message:
        number = pick.choice((*self._ground.protocol.orders, 7))
        again = pick.choice(self._overheard) if self._overheard else bytes(40)
        changed = bytearray(again)
        changed[pick.randrange(len(changed))] ^= 1 << pick.randrange(8)
        order = pick.randrange(1, 9)
        confirmation = MotionConfirmation(
            request_id=number, order_id=order, nonce=NONCE + order
        )
        ours = {"target_system": DRONE[0], "target_component": DRONE[1]}
        kind: Callable[[], Message] = pick.choice(
            (
                lambda: tunnel(SEALED_TYPE, again),
                lambda: tunnel(SEALED_TYPE, bytes(changed)),
                lambda: tunnel(SEALED_TYPE, pick.randbytes(pick.randrange(1, 128))),
                lambda: tunnel(MOTION_TYPE, encode_stop(MotionStop(request_id=number))),
                lambda: tunnel(MOTION_TYPE, encode_confirmation(confirmation)),
                lambda: tunnel(MOTION_TYPE, pick.randbytes(pick.randrange(1, 100))),
                lambda: tunnel(0, b"\x06\0\0\0"),
                lambda: tunnel(0, pick.randbytes(40)),
                lambda: tunnel(RECEIPT_TYPE, Receipt(store=pick.randrange(1, 99)).encode()),
                lambda: tunnel(60_000 + pick.randrange(20), pick.randbytes(60)),
                lambda: made.heartbeat(type=6),
                lambda: dialect.ParamSet(
                    **ours, param_id="DET_K", param_value=5.0, param_type=9
                ),
                lambda: dialect.ParamRequestList(**ours),
                lambda: dialect.FileTransferProtocol(
                    **ours, target_network=0, payload=pick.randbytes(251)
                ),
                lambda: dialect.Ping(time_usec=1, seq=2, target_system=0, target_component=0),
            )
        )
        return kind()


def tunnel(kind: int, payload: bytes, target: tuple[int, int] = DRONE) -> dialect.Tunnel:
    """Write a tunnel message."""
    return made.tunnel(kind, payload, target_system=target[0], target_component=target[1])
