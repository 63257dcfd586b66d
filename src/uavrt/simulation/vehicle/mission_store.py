"""Store missions and fences of the simulated autopilot, by MAVLink's mission protocol.

Uploads are stored and can be downloaded; missions are not flown. There is one upload at a time,
as on PX4 and ArduPilot; a complete new list replaces the old one at once.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.dialect import MavMissionResult, MavMissionType
from uavrt.link.mavlink.message import Message
from uavrt.simulation.vehicle.airframe import Flavour

Place = tuple[int, int]
REQUEST_PERIOD_S: dict[Flavour, float] = {"px4": 0.25, "ardupilot": 1.0}
GIVE_UP_S: dict[Flavour, float] = {"px4": 5.0, "ardupilot": 8.0}
ROOM = 500
KINDS = (MavMissionType.MISSION, MavMissionType.FENCE, MavMissionType.RALLY)
FENCE_COMMANDS = range(5000, 5005)


@dataclass(slots=True)
class _Upload:
    sender: Place
    kind: int
    count: int
    send: Callable[[Message], None]
    heard_s: float
    asked_s: float
    items: list[dialect.MissionItemInt] = field(default_factory=list)


class MissionStore:
    """Stores missions and fences; as on ArduPilot, home is then the first item."""

    def __init__(self, flavour: Flavour) -> None:
        self._flavour: Flavour = flavour
        self.held: dict[int, tuple[dialect.MissionItemInt, ...]] = dict.fromkeys(KINDS, ())
        self._upload: _Upload | None = None

    def receive(
        self, message: Message, sender: Place, now_s: float, send: Callable[[Message], None]
    ) -> bool:
        """Handle a station's message; False if it does not belong to the mission protocol."""
        match message:
            case dialect.MissionCount():
                self._begin(message, sender, now_s, send)
            case dialect.MissionItemInt():
                self._take(message, sender, now_s, send)
            case dialect.MissionRequestList() if message.mission_type in KINDS:
                count = len(self.held[message.mission_type])
                send(dialect.MissionCount(**_to(sender, message.mission_type), count=count))
            case dialect.MissionRequestInt() if message.mission_type in KINDS:
                self._give(message, sender, send)
            case dialect.MissionClearAll():
                for kind in KINDS:
                    if message.mission_type in (kind, MavMissionType.ALL):
                        self.held[kind] = ()
                self._print(sender, message.mission_type, 0, send)
            case dialect.MissionAck():
                self._end(message, sender)
            case dialect.MissionRequestList() | dialect.MissionRequestInt():
                self._print(
                    sender, message.mission_type, MavMissionResult.MISSION_UNSUPPORTED, send
                )
            case _:
                return False
        return True

    def tick(self, now_s: float) -> None:
        """Request a missing item of an upload again, or end the upload."""
        upload = self._upload
        if upload is None:
            return
        if now_s - upload.heard_s > GIVE_UP_S[self._flavour]:
            self._upload = None
        elif now_s - upload.asked_s > REQUEST_PERIOD_S[self._flavour]:
            self._ask(upload, now_s)

    def _begin(
        self,
        message: dialect.MissionCount,
        sender: Place,
        now_s: float,
        send: Callable[[Message], None],
    ) -> None:
        upload, kind = self._upload, message.mission_type
        if upload is not None and (upload.sender != sender or upload.items):
            self._print(sender, kind, MavMissionResult.MISSION_ERROR, send)  # busy
        elif kind not in KINDS:
            self._print(sender, kind, MavMissionResult.MISSION_UNSUPPORTED, send)
        elif message.count > ROOM:
            self._print(sender, kind, MavMissionResult.MISSION_NO_SPACE, send)
        elif message.count == 0:
            self.held[kind] = ()
            self._print(sender, kind, MavMissionResult.MISSION_ACCEPTED, send)
        else:
            self._upload = _Upload(sender, kind, message.count, send, now_s, now_s)
            self._ask(self._upload, now_s)

    def _ask(self, upload: _Upload, now_s: float) -> None:
        upload.asked_s = now_s
        number = len(upload.items)
        upload.send(dialect.MissionRequestInt(**_to(upload.sender, upload.kind), seq=number))

    def _take(
        self,
        message: dialect.MissionItemInt,
        sender: Place,
        now_s: float,
        send: Callable[[Message], None],
    ) -> None:
        upload, kind = self._upload, message.mission_type
        if upload is None or (upload.sender, upload.kind) != (sender, kind):
            self._print(sender, kind, MavMissionResult.MISSION_ERROR, send)
            return
        if message.seq != len(upload.items):
            if self._flavour == "px4":
                self._ask(upload, now_s)
            else:
                self._print(sender, kind, MavMissionResult.MISSION_INVALID_SEQUENCE, send)
            return
        if (message.command in FENCE_COMMANDS) != (kind == MavMissionType.FENCE):
            self._upload = None
            self._print(sender, kind, MavMissionResult.MISSION_UNSUPPORTED, send)
            return
        upload.heard_s = now_s
        upload.items.append(message)
        if len(upload.items) < upload.count:
            self._ask(upload, now_s)
            return
        self._upload = None
        self.held[kind] = tuple(upload.items)
        self._print(sender, kind, MavMissionResult.MISSION_ACCEPTED, send)

    def _give(
        self, message: dialect.MissionRequestInt, sender: Place, send: Callable[[Message], None]
    ) -> None:
        kind = message.mission_type
        items = self.held[kind]
        if message.seq >= len(items):
            self._print(sender, kind, MavMissionResult.MISSION_INVALID_SEQUENCE, send)
            return
        item = items[message.seq]
        values = {name: getattr(item, name) for name in item.__slots__}
        send(dialect.MissionItemInt(**(values | _to(sender, kind) | {"seq": message.seq})))

    def _end(self, message: dialect.MissionAck, sender: Place) -> None:
        upload = self._upload
        if upload is not None and upload.sender == sender and message.type:
            self._upload = None

    def _print(
        self, sender: Place, kind: int, result: int, send: Callable[[Message], None]
    ) -> None:
        send(dialect.MissionAck(**_to(sender, kind), type=result))


def _to(sender: Place, kind: int) -> dict[str, int]:
    return {"target_system": sender[0], "target_component": sender[1], "mission_type": kind}
