"""Motion by the page's server, against a drone that speaks real frames and flies nothing."""

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from tests.system.ground.test_session import Drone, until

from uavrt.errors import FormatError
from uavrt.ground.link.flying import area_of_file
from uavrt.mavlink import Message, dialect
from uavrt.mavlink.frame import FrameParser, FrameWriter
from uavrt.messages import MotionRequest, SystemState
from uavrt.simulation.mission_store import MissionStore
from uavrt.tunnel import (
    MOTION_STATE_TYPE,
    MOTION_TYPE,
    MotionConfirmation,
    MotionState,
    MotionStop,
    decode_motion,
    encode_state,
)

GROUND = (254, 190)


class FlyingDrone(Drone):
    """Offers what it is asked for, and obeys confirmations and stops; keeps what came."""

    def __init__(self, port: int) -> None:
        super().__init__(port)
        self.came: list[Any] = []
        self.refusal = ""
        self._ended = threading.Event()
        self._sock.settimeout(0.1)
        self._parser = FrameParser()
        self.missions = MissionStore("px4")
        self.mode, self.beats = 3 << 16, 0
        self._autopilot = FrameWriter(1, 1)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def tell(self, state: MotionState) -> None:
        payload = encode_state(state)
        self.send(
            dialect.Tunnel(
                target_system=0,
                target_component=0,
                payload_type=MOTION_STATE_TYPE,
                payload_length=len(payload),
                payload=payload,
            )
        )

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        super().close()

    def _serve(self) -> None:
        while not self._ended.is_set():
            self.heartbeat(SystemState.IDLE)
            self._as_autopilot(
                dialect.Heartbeat(
                    type=2,
                    autopilot=12,
                    base_mode=0,
                    custom_mode=self.mode,
                    system_status=4,
                    mavlink_version=3,
                )
            )
            self.beats += 1
            self.tell(MotionState(kind="state", standing=self.standing, text="as told"))
            try:
                data = self._sock.recv(4096)
            except (TimeoutError, ConnectionRefusedError):
                continue
            for frame in self._parser.feed(data):
                message = frame.message()
                sender = (frame.system_id, frame.component_id)
                if isinstance(message, dialect.CommandLong) and message.target_component == 1:
                    self._as_autopilot(self._home())
                if message is not None:
                    self.missions.receive(message, sender, 0.0, self._as_autopilot)
                if isinstance(message, dialect.Tunnel) and message.payload_type == MOTION_TYPE:
                    self._take(decode_motion(message.payload[: message.payload_length], GROUND))

    def _home(self) -> Message:
        """Where it is asked for: at a corner of the area."""
        return dialect.HomePosition(
            latitude=465_000_000,
            longitude=80_000_000,
            altitude=800_000,
            q=(1.0, 0.0, 0.0, 0.0),
            x=0.0,
            y=0.0,
            z=0.0,
            approach_x=0.0,
            approach_y=0.0,
            approach_z=0.0,
        )

    def _as_autopilot(self, message: Message) -> None:
        self._sock.send(self._autopilot.encode(message))

    @property
    def standing(self) -> Any:
        last = self.came[-1] if self.came else None
        return "in command" if isinstance(last, MotionConfirmation) else "out"

    def _take(self, what: Any) -> None:
        self.came.append(what)
        number = what.request_id
        if isinstance(what, MotionRequest) and self.refusal:
            self.tell(
                MotionState(
                    kind="refused", standing="out", text=self.refusal, request_id=number
                )
            )
        elif isinstance(what, MotionRequest):
            self.tell(
                MotionState(
                    kind="offer",
                    standing="out",
                    text=f"{what.action} at 40 m",
                    request_id=number,
                    order_id=77,
                    nonce=88,
                )
            )
        else:
            self.tell(
                MotionState(kind="state", standing=self.standing, text="yes", request_id=number)
            )


@pytest.fixture
def drone(served: Any) -> Iterator[FlyingDrone]:
    made = FlyingDrone(served.mavlink_port)
    until(served, lambda state: state["drone"]["present"] and state["motion"] is not None)
    yield made
    made.close()


def test_a_motion_is_offered_confirmed_once_and_stopped(
    served: Any, drone: FlyingDrone
) -> None:
    wish = {"action": "rotate", "duration_s": 40, "clockwise": False, "height_m": 45}
    offer = served.ask("POST", "/api/motion/ask", wish)
    assert offer.json["text"] == "rotate at 40 m"
    asked = drone.came[-1]
    assert (asked.duration_s, asked.clockwise, asked.height_m) == (40.0, False, 45.0)
    state = until(served, lambda state: state["motion"]["offer"] is not None)
    assert state["motion"]["offer"]["order_id"] == 77
    assert served.ask("POST", "/api/motion/confirm", {"order_id": 78}).status == 409
    assert not any(isinstance(one, MotionConfirmation) for one in drone.came)
    done = served.ask("POST", "/api/motion/confirm", {"order_id": 77, "sticks_unseen": True})
    assert done.json["standing"] == "in command"
    assert (drone.came[-1].nonce, drone.came[-1].sticks_unseen) == (88, True)
    assert served.ask("POST", "/api/motion/confirm", {"order_id": 77}).status == 409
    stopped = served.ask("POST", "/api/motion/stop", {})
    assert stopped.json["standing"] == "out"
    assert isinstance(drone.came[-1], MotionStop)
    assert sum(isinstance(one, MotionConfirmation) for one in drone.came) == 1


def test_a_refusal_is_told_in_the_drones_words(served: Any, drone: FlyingDrone) -> None:
    drone.refusal = "the way leads 900 m from home, beyond the fence"
    answer = served.ask("POST", "/api/motion/ask", {"action": "hold"})
    assert answer.status == 409
    assert answer.json["error"] == drone.refusal


def test_only_the_page_that_commands_asks_and_every_page_takes_back(
    served: Any, drone: FlyingDrone
) -> None:
    for page in ("first", "second"):
        served.station.session.commander.come(page)
    first, second = {"X-Page": "first"}, {"X-Page": "second"}
    refused = served.ask("POST", "/api/motion/ask", {"action": "hold"}, second)
    assert refused.status == 409
    assert "another page commands" in refused.json["error"]
    assert served.ask("POST", "/api/motion/ask", {"action": "hold"}, first).status == 200
    served.station.session.commander.take("second")
    # Whoever has taken command meanwhile confirms nothing that another has asked for.
    confirming = {"order_id": 77}
    assert served.ask("POST", "/api/motion/confirm", confirming, second).status == 409
    assert served.ask("POST", "/api/motion/confirm", confirming, first).status == 409
    assert not any(isinstance(one, MotionConfirmation) for one in drone.came)
    assert served.ask("POST", "/api/motion/stop", {}, first).status == 200


def test_taking_back_waits_for_no_other_command(served: Any, drone: FlyingDrone) -> None:
    """The drone does not answer the tags, which are sent again and again meanwhile."""
    row = {"frequency_mhz": 148.71, "interval_ms": 1254, "pulse_width_ms": 20, "id": 2}
    assert served.ask("PUT", "/api/tags", [row]).status == 200
    sending = threading.Thread(target=served.ask, args=("POST", "/api/commands/send_tags", {}))
    sending.start()
    until(served, lambda state: state["busy"] is not None)
    assert served.ask("POST", "/api/motion/stop", {}).status == 200
    assert served.ask("GET", "/api/state").json["busy"] is not None
    sending.join()


def test_the_way_is_shown_before_anything_is_asked(served: Any, drone: FlyingDrone) -> None:
    square = [[46.5, 8.0], [46.5, 8.002], [46.501, 8.002], [46.501, 8.0]]
    wish = {"action": "survey", "places": square, "spacing_m": 40}
    lines = served.ask("POST", "/api/motion/plan", wish).json
    assert len(lines["way"]) == 6
    assert lines["length_m"] == pytest.approx(3 * 153.0 + 2 * 37.0, rel=0.05)
    around = served.ask("POST", "/api/motion/plan", wish | {"pattern": "around"}).json
    assert around["way"] == [*square, square[0]]
    assert not drone.came
    crossing = [square[0], square[2], square[1], square[3]]
    answer = served.ask("POST", "/api/motion/plan", wish | {"places": crossing})
    assert answer.status == 422
    circle = {"center": [46.5, 8.0], "radius_m": 50}
    assert len(served.ask("POST", "/api/motion/area", circle).json["places"]) == 20


MISSION = {
    "action": "survey",
    "places": [[46.5, 8.0], [46.5, 8.002], [46.501, 8.002], [46.501, 8.0]],
    "spacing_m": 40,
    "height_m": 60,
}


def test_a_survey_becomes_the_vehicles_mission_and_nothing_is_asked_of_the_drone(
    served: Any, drone: FlyingDrone
) -> None:
    answer = served.ask("POST", "/api/motion/upload", MISSION)
    assert answer.json == {"items": 7, "sent_again": 0}
    assert [item.command for item in drone.missions.held[0]] == [16] * 6 + [20]
    assert not drone.came


def test_a_mission_that_is_none_or_is_flown_is_not_replaced(
    served: Any, drone: FlyingDrone
) -> None:
    turns = served.ask("POST", "/api/motion/upload", MISSION | {"pattern": "points"})
    assert turns.status == 422
    assert "holds no turns" in turns.json["error"]
    assert served.ask("POST", "/api/motion/upload", MISSION | {"height_m": None}).status == 422
    drone.mode = 4 << 16 | 4 << 24
    told = drone.beats + 2
    while drone.beats < told:
        time.sleep(0.02)
    flown = served.ask("POST", "/api/motion/upload", MISSION)
    assert flown.status == 409
    assert "would change its way" in flown.json["error"]
    assert not drone.missions.held[0]


@pytest.mark.parametrize(
    "wish",
    [
        [],
        "hold",
        {"action": "loop"},
        {"action": "goto", "places": [[95, 8]]},
        {"action": "goto", "places": "here"},
        {"action": "rotate", "duration_s": "fast"},
        {"action": "rotate", "height_m": True},
        {"action": "survey"},
        {"action": "search"},
        {"action": "search", "radius_m": 100, "places": [[46.5, 8.0]] * 3},
        {"action": "search", "radius_m": 100, "tags": ["lynx"]},
        {"action": "survey", "places": [[46.5, 8.0]] * 3, "pattern": "star"},
    ],
)
def test_what_is_no_motion_is_refused_before_the_drone_hears_of_it(
    served: Any, drone: FlyingDrone, wish: object
) -> None:
    assert served.ask("POST", "/api/motion/ask", wish).status == 422
    assert drone.came == []


def test_a_search_is_asked_for_with_its_area_and_its_wish(
    served: Any, drone: FlyingDrone
) -> None:
    wish = {
        "action": "search",
        "radius_m": 200,
        "wish_m": 30,
        "tags": [2, 4],
        "duration_s": 600,
    }
    assert served.ask("POST", "/api/motion/ask", wish).json["text"] == "search at 40 m"
    asked = drone.came[-1]
    assert (asked.radius_m, asked.wish_m, asked.tags) == (200.0, 30.0, (2, 4))
    assert asked.duration_s == 600.0
    assert asked.places == ()


def test_without_a_drone_taking_back_says_who_must(served: Any) -> None:
    answer = served.ask("POST", "/api/motion/stop", {})
    assert answer.status == 409
    assert "remote control" in answer.json["error"]


def test_a_file_that_gives_no_area_is_named(served: Any) -> None:
    answer = served.ask("POST", "/api/motion/area", {"name": "x.kml", "text": "<kml/>"})
    assert answer.status == 422
    assert "x.kml gives no area" in answer.json["error"]


@pytest.mark.parametrize("radius_m", [10**400, True, "80", None, 1e999])
def test_a_circle_of_no_number_is_refused(radius_m: Any) -> None:
    with pytest.raises(FormatError, match="radius_m must be a number"):
        area_of_file({"center": [47.0, 8.0], "radius_m": radius_m})
