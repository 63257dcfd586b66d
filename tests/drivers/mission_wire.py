"""A link that loses messages, between a transfer and the simulated autopilot's missions."""

import random
from collections.abc import Callable

from uavrt.link.mavlink.autopilot.mission_transfer import MissionTransfer
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.message import Message
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.mission_store import MissionStore

VEHICLE, OWN = Peer(1, 1), (254, 190)
STEP_S, DELAY_S = 0.05, 0.1


class MissionWire:
    """Virtual time; each message takes a tenth of a second, if it arrives."""

    def __init__(self, flavour: Flavour, *, loss: float = 0.0, seed: int = 1) -> None:
        self.store = MissionStore(flavour)
        self.loss, self.random = loss, random.Random(seed)
        self.now_s = 100.0
        self.sent: list[Message] = []
        self.also: Callable[[float], list[Message]] = lambda now_s: []
        """What somebody else says to us meanwhile, in the vehicle's name."""
        self._up: list[tuple[float, Message]] = []
        self._down: list[tuple[float, Message]] = []

    def run(self, transfer: MissionTransfer, most_s: float = 600.0) -> float:
        """Run a transfer to its end; how long it took."""
        begun_s = self.now_s
        while not transfer.over and self.now_s < begun_s + most_s:
            self.now_s += STEP_S
            self.store.tick(self.now_s)
            self._send(transfer.due(self.now_s))
            for message in [*_arrived(self._down, self.now_s), *self.also(self.now_s)]:
                place = (VEHICLE.system_id, VEHICLE.component_id)
                self._send(transfer.receive(message, place, self.now_s))
            for message in _arrived(self._up, self.now_s):
                self.store.receive(message, OWN, self.now_s, self._reply)
        return self.now_s - begun_s

    def _send(self, messages: list[Message]) -> None:
        self.sent += messages
        for message in messages:
            self._put(self._up, message)

    def _reply(self, message: Message) -> None:
        self._put(self._down, message)

    def _put(self, queue: list[tuple[float, Message]], message: Message) -> None:
        if self.random.random() >= self.loss:
            queue.append((self.now_s + DELAY_S, type(message).decode(message.pack())))


def _arrived(queue: list[tuple[float, Message]], now_s: float) -> list[Message]:
    there = [message for time_s, message in queue if time_s <= now_s]
    queue[:] = [one for one in queue if one[0] > now_s]
    return there
