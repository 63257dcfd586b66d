"""Upload and download missions and fences by MAVLink's mission protocol; no I/O.

A transfer object receives messages and the time, and returns the messages to send. In an
upload, the vehicle requests each item and repeats the request if the item was lost. In a
download, this side requests each item from the vehicle
(https://mavlink.io/en/services/mission.html). This module never starts a mission.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from math import isfinite, isnan

from uavrt.guidance.files.mission import MissionItem, MissionKind
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.dialect import MavMissionResult, MavMissionType
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.message import Message

MOST_ITEMS = 1000
"""Largest number of items in a mission download; ArduPilot holds some 700, PX4 2000."""
RETRY_S = 1.0
"""Time after which an unanswered mission request is repeated [s]; a full send queue at 57 600
baud empties within this time."""
TRIES = 12
"""Number of times a mission request is sent before the transfer fails. At 20 % loss in each
direction, one in 200 000 requests stays unanswered."""
SILENCE_S = 6.0
"""Time without a request from the vehicle after which a mission upload fails [s]. PX4 repeats
its requests for 5 s, ArduPilot for 8 s."""
LIMIT_S, LIMIT_PER_ITEM_S = 60.0, 2.0
"""Longest duration of a whole mission transfer, and additional time for each item [s]."""
LAST_S = 3.0
"""Longest wait for the vehicle's final answer after all items were uploaded [s]. Afterwards, a
download checks what the vehicle has stored."""
_TYPES: dict[MissionKind, int] = {
    "mission": MavMissionType.MISSION,
    "fence": MavMissionType.FENCE,
}
_REFUSALS: dict[int, str] = {
    MavMissionResult.MISSION_ERROR: "it cannot accept a mission now",
    MavMissionResult.MISSION_UNSUPPORTED_FRAME: "the coordinate frame is not supported",
    MavMissionResult.MISSION_UNSUPPORTED: "a kind of item is not supported",
    MavMissionResult.MISSION_NO_SPACE: "the mission has more items than it can store",
    MavMissionResult.MISSION_DENIED: "it accepts no missions from this station",
    MavMissionResult.MISSION_OPERATION_CANCELLED: "it was cancelled",
}
_OURS = (
    dialect.MissionCount,
    dialect.MissionRequestInt,
    dialect.MissionRequest,
    dialect.MissionItemInt,
    dialect.MissionAck,
)


class MissionTransfer(ABC):
    """Base of mission upload and download."""

    def __init__(self, kind: MissionKind, vehicle: Peer, own: tuple[int, int]) -> None:
        self._type = _TYPES[kind]
        self._vehicle, self._own = vehicle, own
        self.done = False
        self.fault: str | None = None
        self.silent = False
        self.counters: Counter[str] = Counter()
        self._tries = 0
        self._due_s = 0.0
        self._begun_s: float | None = None

    @property
    def over(self) -> bool:
        """True once the transfer has succeeded or failed."""
        return self.done or self.fault is not None

    def receive(self, message: Message, sender: tuple[int, int], now_s: float) -> list[Message]:
        """Handle a received message; return the messages to send at once."""
        if self.over or not isinstance(message, _OURS):
            return []
        place = (message.target_system, message.target_component)
        if sender != self._vehicle.place:
            return self._ignore_unexpected()
        if place != self._own or message.mission_type != self._type:
            return self._ignore_unexpected()
        return self._take(message, now_s)

    def due(self, now_s: float) -> list[Message]:
        """Return the messages that must be sent now, first or repeated."""
        if self.over:
            return []
        if self._begun_s is None:
            self._begun_s = now_s
        limit_s = LIMIT_S + LIMIT_PER_ITEM_S * self._size
        if now_s - self._begun_s > limit_s:
            return self.cancel(f"the transfer took longer than {limit_s:.0f} s")
        return self._again(now_s) if now_s >= self._due_s else []

    def cancel(self, reason: str) -> list[Message]:
        """Cancel the transfer; the vehicle keeps its previous mission."""
        if self.over:
            return []
        self.fault = reason
        return [self._ack(MavMissionResult.MISSION_OPERATION_CANCELLED)]

    @property
    @abstractmethod
    def _size(self) -> int:
        """Number of mission items; 0 while unknown."""

    @abstractmethod
    def _take(self, message: Message, now_s: float) -> list[Message]:
        """Handle the autopilot's mission message; return the messages to send."""

    @abstractmethod
    def _again(self, now_s: float) -> list[Message]:
        """Return the mission requests that must be sent now, first or repeated."""

    def _ignore_unexpected(self) -> list[Message]:
        self.counters["strange"] += 1
        return []

    def _try(self, message: Message, now_s: float) -> list[Message]:
        """Return a mission request to send; the transfer fails after `TRIES` requests."""
        if self._tries >= TRIES:
            self.fault = f"the autopilot did not answer in {TRIES * RETRY_S:.0f} s"
            self.silent = True
            return []
        if self._tries > 0:
            self.counters["sent_again"] += 1
        self._tries += 1
        self._due_s = now_s + RETRY_S
        return [message]

    def _answered(self, now_s: float, wait_s: float) -> None:
        self._tries, self._due_s = 0, now_s + wait_s

    def _refused(self, message: dialect.MissionAck) -> None:
        why = _REFUSALS.get(message.type, f"a mission item is invalid (result {message.type})")
        self.fault = f"the autopilot refused: {why}"

    def _ack(self, result: int) -> Message:
        return dialect.MissionAck(**self._to(), type=result)

    def _to(self) -> dict[str, int]:
        return {**self._vehicle.address, "mission_type": self._type}


class MissionUpload(MissionTransfer):
    """Sends each mission item when the vehicle requests it; parameters as `MissionTransfer`."""

    def __init__(
        self,
        items: Sequence[MissionItem],
        kind: MissionKind,
        vehicle: Peer,
        own: tuple[int, int],
    ) -> None:
        super().__init__(kind, vehicle, own)
        self._items = tuple(items)
        self._asked: set[int] = set()
        self.acknowledged = False
        """True once the vehicle acknowledged the upload; else a download shows the result."""

    @property
    def _size(self) -> int:
        return len(self._items)

    def _take(self, message: Message, now_s: float) -> list[Message]:
        match message:
            case dialect.MissionRequestInt() | dialect.MissionRequest():
                return self._give(message.seq, now_s)
            case dialect.MissionAck(type=MavMissionResult.MISSION_ACCEPTED):
                if len(self._asked) < len(self._items):
                    return self._ignore_unexpected()
                self.done = self.acknowledged = True
            case dialect.MissionAck(type=MavMissionResult.MISSION_INVALID_SEQUENCE):
                self.counters["out_of_sequence"] += 1  # a copy of what it had: it asks again
            case dialect.MissionAck():
                self._refused(message)
            case _:
                return self._ignore_unexpected()
        return []

    def _give(self, number: int, now_s: float) -> list[Message]:
        if number >= len(self._items):
            return self._ignore_unexpected()
        if number in self._asked:
            self.counters["sent_again"] += 1
        self._asked.add(number)
        whole = len(self._asked) == len(self._items)
        self._answered(now_s, LAST_S if whole else SILENCE_S)
        item = self._items[number]
        one, two, three, four = item.params
        return [
            dialect.MissionItemInt(
                **self._to(),
                seq=number,
                frame=item.frame,
                command=item.command,
                autocontinue=1,
                x=item.x,
                y=item.y,
                z=item.z,
                param1=one,
                param2=two,
                param3=three,
                param4=four,
            )
        ]

    def _again(self, now_s: float) -> list[Message]:
        if self._items and len(self._asked) == len(self._items):
            self.done = True  # the answer was lost, or the last item
            return []
        self._asked.clear()
        return self._try(dialect.MissionCount(**self._to(), count=len(self._items)), now_s)


class MissionDownload(MissionTransfer):
    """Downloads a mission by requesting each item; `items` holds the items received so far."""

    def __init__(self, kind: MissionKind, vehicle: Peer, own: tuple[int, int]) -> None:
        super().__init__(kind, vehicle, own)
        self._count: int | None = None
        self.items: list[MissionItem] = []

    @property
    def _size(self) -> int:
        return self._count or 0

    def _take(self, message: Message, now_s: float) -> list[Message]:
        match message:
            case dialect.MissionCount() if self._count is None:
                return self._begin(message.count, now_s)
            case dialect.MissionItemInt() if self._count is not None:
                return self._add(message, now_s)
            case dialect.MissionAck() if message.type != MavMissionResult.MISSION_ACCEPTED:
                self._refused(message)
                return []
        return self._ignore_unexpected()

    def _begin(self, count: int, now_s: float) -> list[Message]:
        if count > MOST_ITEMS:
            self.fault = f"the autopilot reports {count} items, more than {MOST_ITEMS}"
            return [self._ack(MavMissionResult.MISSION_NO_SPACE)]
        self._count = count
        return self._next(now_s)

    def _add(self, message: dialect.MissionItemInt, now_s: float) -> list[Message]:
        if message.seq != len(self.items):
            return self._ignore_unexpected()  # a copy, or out of turn: asked for again in time
        params = (message.param1, message.param2, message.param3, message.param4)
        if not isfinite(message.z) or not all(isnan(one) or isfinite(one) for one in params):
            self.fault = f"the autopilot's item {message.seq + 1} has an invalid number"
            return [self._ack(MavMissionResult.MISSION_ERROR)]
        self.items.append(
            MissionItem(
                command=message.command,
                frame=message.frame,
                params=params,
                x=message.x,
                y=message.y,
                z=message.z,
            )
        )
        return self._next(now_s)

    def _next(self, now_s: float) -> list[Message]:
        self._answered(now_s, 0.0)
        if len(self.items) == self._count:
            self.done = True
            return [self._ack(MavMissionResult.MISSION_ACCEPTED)]
        return self._again(now_s)

    def _again(self, now_s: float) -> list[Message]:
        if self._count is None:
            return self._try(dialect.MissionRequestList(**self._to()), now_s)
        return self._try(dialect.MissionRequestInt(**self._to(), seq=len(self.items)), now_s)


def with_home(items: Sequence[MissionItem], *, home_first: bool) -> tuple[MissionItem, ...]:
    """Insert a home item before a mission if `home_first`: ArduPilot stores home in item 0."""
    first = (MissionItem(command=16),) if home_first else ()
    return (*first, *items)
