"""The component against hand-made frames and an invented clock: no sockets."""

from typing import TypeVar

import made
import pytest

from uavrt.core.messages import AttitudeSample, PositionSample
from uavrt.link.mavlink import dialect as d
from uavrt.link.mavlink.component import Component, Handlers
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.mavlink.message import Message

START_NS = 1_700_000_000 * 10**9
SECOND = 10**9
M = TypeVar("M", bound=Message)


class Bench:
    """A component whose clock moves only when told, and everything it sent and gave."""

    def __init__(self) -> None:
        self.now_ns = START_NS
        self.sent: list[Message] = []
        self.attitudes: list[AttitudeSample] = []
        self.positions: list[PositionSample] = []
        self.tunnels: list[tuple[bytes, Peer]] = []
        self.buffers: list[int] = []
        self.component = Component(
            self.sent.append,
            Handlers(
                attitude=self.attitudes.append,
                position=self.positions.append,
                tunnel=lambda payload, peer: self.tunnels.append((payload, peer)),
                radio_status=lambda status: self.buffers.append(status.txbuf),
            ),
        )

    def hear(self, message: Message, system_id: int = 1, component_id: int = 1) -> None:
        raw = FrameWriter(system_id, component_id).encode(message)
        for frame in FrameParser().feed(raw):
            self.component.receive(frame, self.now_ns)

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.05)):
            self.now_ns += 50_000_000
            self.component.tick(self.now_ns)

    def take(self, kind: type[M]) -> list[M]:
        found = [message for message in self.sent if isinstance(message, kind)]
        self.sent[:] = [message for message in self.sent if not isinstance(message, kind)]
        return found

    def autopilot_heartbeat(self, system_id: int = 1) -> None:
        self.hear(heartbeat(d.MavType.QUADROTOR, d.MavAutopilot.PX4), system_id)

    def station_heartbeat(self, system_id: int = 255, component_id: int = 190) -> None:
        message = heartbeat(d.MavType.GCS, d.MavAutopilot.INVALID)
        self.hear(message, system_id, component_id)

    def fly(self, seconds: int, boot_start_ms: int = 10_000) -> None:
        """Let an autopilot run that answers TIMESYNC and acknowledges."""
        for second in range(seconds):
            self.autopilot_heartbeat()
            for step in range(20):
                self.wait(0.05)
                boot_ms = boot_start_ms + second * 1000 + step * 50
                for ask in self.take(d.Timesync):
                    answer = d.Timesync(tc1=boot_ms * 1_000_000, ts1=ask.ts1)
                    self.hear(answer)
                self.hear(attitude(boot_ms))
                self.hear(position(boot_ms))


def heartbeat(kind: int, autopilot: int) -> d.Heartbeat:
    return made.heartbeat(type=kind, autopilot=autopilot)


def attitude(boot_ms: int) -> d.AttitudeQuaternion:
    return d.AttitudeQuaternion(
        time_boot_ms=boot_ms, q1=1, q2=0, q3=0, q4=0, rollspeed=0, pitchspeed=0, yawspeed=0
    )


def position(boot_ms: int) -> d.GlobalPositionInt:
    return d.GlobalPositionInt(
        time_boot_ms=boot_ms,
        lat=351782410,
        lon=-1116565870,
        alt=2157000,
        relative_alt=50000,
        vx=0,
        vy=0,
        vz=0,
        hdg=0,
    )


def command(number: int, *, component: int = 191, param1: float = 0.0) -> d.CommandLong:
    return made.command_long(number, param1, target_component=component)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_it_is_silent_at_first_and_takes_the_autopilots_system_id(bench: Bench) -> None:
    bench.wait(2.0)
    assert bench.take(d.Heartbeat) == []
    bench.autopilot_heartbeat(system_id=42)
    bench.wait(0.1)
    (beat,) = bench.take(d.Heartbeat)
    assert (beat.type, beat.autopilot) == (18, 8)
    assert (bench.component.system_id, bench.component.component_id) == (42, 191)


def test_alone_on_a_link_it_shows_itself_after_three_seconds(bench: Bench) -> None:
    bench.wait(6.5)
    assert len(bench.take(d.Heartbeat)) == 4
    assert bench.component.system_id == 1


def test_its_heartbeat_comes_once_a_second(bench: Bench) -> None:
    for _ in range(10):
        bench.autopilot_heartbeat()
        bench.wait(1.0)
    assert len(bench.take(d.Heartbeat)) == 10


def test_a_second_vehicle_on_the_radio_is_not_ours(bench: Bench) -> None:
    bench.autopilot_heartbeat(system_id=1)
    bench.autopilot_heartbeat(system_id=2)
    assert bench.component.system_id == 1
    bench.hear(attitude(1000), system_id=2)
    assert bench.component.counters["foreign_poses"] == 1


def test_after_the_autopilot_is_lost_another_number_may_take_its_place(bench: Bench) -> None:
    bench.autopilot_heartbeat(system_id=1)
    bench.wait(6.0)
    bench.autopilot_heartbeat(system_id=3)
    assert bench.component.system_id == 3


@pytest.mark.parametrize("station", [(255, 190), (245, 190), (255, 230)])
@pytest.mark.parametrize("first", ["autopilot", "station"])
def test_any_ground_station_is_found_by_its_type_in_any_order(
    bench: Bench, station: tuple[int, int], first: str
) -> None:
    if first == "autopilot":
        bench.autopilot_heartbeat()
    bench.station_heartbeat(*station)
    bench.autopilot_heartbeat()
    assert bench.component.discovery.target(bench.now_ns) == Peer(*station)


def test_two_ground_stations_are_both_addressed_and_a_silent_one_is_kept(bench: Bench) -> None:
    bench.station_heartbeat(255, 190)
    bench.station_heartbeat(245, 190)
    assert bench.component.discovery.target(bench.now_ns) == Peer(0, 0)
    bench.wait(8.0)
    bench.station_heartbeat(245, 190)
    bench.wait(8.0)
    assert bench.component.discovery.target(bench.now_ns) == Peer(245, 190)
    bench.wait(60.0)
    assert bench.component.discovery.target(bench.now_ns) == Peer(245, 190)
    assert not bench.component.discovery.station_present(bench.now_ns)


def test_streams_are_asked_for_one_after_another_at_their_rates(bench: Bench) -> None:
    bench.autopilot_heartbeat()
    asked = {}
    for _ in range(20):
        bench.wait(0.05)
        for request in bench.take(d.CommandLong):
            asked[int(request.param1)] = request.param2
            assert (request.target_system, request.target_component) == (1, 1)
            bench.hear(d.CommandAck(command=511, result=0))
    assert asked == {31: 20_000.0, 33: 100_000.0, 2: 1_000_000.0}
    assert bench.component.streams.requests == 3


def test_an_unanswered_request_is_repeated_and_then_given_up_for_a_while(bench: Bench) -> None:
    bench.autopilot_heartbeat()
    for _ in range(9):
        bench.wait(1.0)
        bench.autopilot_heartbeat()
    assert 15 <= len(bench.take(d.CommandLong)) <= 18


def test_a_stream_that_stops_is_asked_for_again(bench: Bench) -> None:
    bench.fly(5)
    bench.take(d.CommandLong)
    for _ in range(5):
        bench.autopilot_heartbeat()
        bench.wait(1.0)
        for _ in bench.take(d.CommandLong):
            bench.hear(d.CommandAck(command=511, result=0))
    assert bench.component.streams.requests >= 6


def test_poses_come_out_on_our_clock(bench: Bench) -> None:
    bench.fly(10)
    last_attitude, last_position = bench.attitudes[-1], bench.positions[-1]
    assert abs(last_attitude.time_ns - bench.now_ns) < 2_000_000
    assert last_attitude.quaternion_wxyz == (1.0, 0.0, 0.0, 0.0)
    assert last_position.latitude_deg == 35.178241
    assert last_position.longitude_deg == -111.656587
    assert (last_position.altitude_amsl_m, last_position.altitude_relative_m) == (2157.0, 50.0)


def test_a_quaternion_that_is_none_is_counted_and_not_handed_on(bench: Bench) -> None:
    bench.fly(2)
    bench.attitudes.clear()
    for parts in [(0.0, 0.0, 0.0, 0.0), (float("nan"), 0.0, 0.0, 1.0), (1.0, 1.0, 0.0, 0.0)]:
        message = attitude(12_000)
        message.q1, message.q2, message.q3, message.q4 = parts
        bench.hear(message)
    assert bench.attitudes == []
    assert bench.component.counters["bad_attitudes"] == 3


@pytest.mark.parametrize(
    ("lat", "lon"), [(0, 0), (900_000_001, 1), (1, 1_800_000_001), (-(2**31), 5)]
)
def test_a_position_without_a_fix_is_only_counted(bench: Bench, lat: int, lon: int) -> None:
    bench.fly(2)
    bench.positions.clear()
    message = position(12_000)
    message.lat, message.lon = lat, lon
    bench.hear(message)
    assert bench.positions == []
    assert bench.component.counters["positions_without_fix"] == 1


def test_times_are_right_again_soon_after_the_autopilot_restarts(bench: Bench) -> None:
    bench.fly(10, boot_start_ms=1_000_000)
    bench.attitudes.clear()
    bench.fly(3, boot_start_ms=500)
    assert bench.component.counters["autopilot_reboots"] == 1
    now_ns = bench.now_ns
    times = [sample.time_ns for sample in bench.attitudes]
    assert len(times) >= 55
    for late, time_ns in enumerate(reversed(times)):
        assert abs(time_ns - (now_ns - late * 50_000_000)) < 5_000_000
    bench.wait(0.1)
    asked = {int(request.param1) for request in bench.take(d.CommandLong)}
    assert asked >= {31}


def test_an_answer_is_ours_by_its_time_stamp_whatever_its_target_says(bench: Bench) -> None:
    # PX4 1.17 answers with targets that it never set.
    bench.autopilot_heartbeat()
    bench.wait(0.1)
    (ask,) = bench.take(d.Timesync)[:1]
    bench.hear(d.Timesync(tc1=5 * SECOND, ts1=ask.ts1 + 1))
    bench.hear(d.Timesync(tc1=5 * SECOND, ts1=ask.ts1), system_id=1, component_id=25)
    assert not bench.component.time_sync.synchronized
    assert bench.component.counters["timesync_foreign"] == 2
    answer = d.Timesync(tc1=5 * SECOND, ts1=ask.ts1, target_system=224, target_component=92)
    bench.hear(answer)
    assert bench.component.time_sync.synchronized
    bench.hear(answer)
    assert bench.component.time_sync.round_trips == 1


def test_the_autopilots_own_question_of_time_is_answered_to_it(bench: Bench) -> None:
    bench.autopilot_heartbeat()
    bench.hear(d.Timesync(tc1=0, ts1=777))
    (answer,) = bench.take(d.Timesync)
    assert (answer.tc1, answer.ts1) == (bench.now_ns, 777)
    assert (answer.target_system, answer.target_component) == (1, 1)


def test_a_ping_to_all_is_answered_to_its_sender(bench: Bench) -> None:
    bench.hear(d.Ping(time_usec=5, seq=9, target_system=0, target_component=0), 255, 190)
    (answer,) = bench.take(d.Ping)
    assert (answer.time_usec, answer.seq) == (5, 9)
    assert (answer.target_system, answer.target_component) == (255, 190)


def test_a_command_to_all_or_to_the_autopilot_is_left_to_the_autopilot(bench: Bench) -> None:
    bench.hear(command(400, component=0), 255, 190)
    bench.hear(command(400, component=1), 255, 190)
    assert bench.take(d.CommandAck) == []


@pytest.mark.parametrize(
    ("number", "param1", "kind"),
    [
        (512, 148, d.AutopilotVersion),
        (512, 300, d.ProtocolVersion),
        (512, 396, d.ComponentInformationBasic),
        (520, 1, d.AutopilotVersion),
        (519, 1, d.ProtocolVersion),
    ],
)
def test_identity_is_told_on_request(
    bench: Bench, number: int, param1: float, kind: type[Message]
) -> None:
    bench.hear(command(number, param1=param1), 255, 190)
    (ack,) = bench.take(d.CommandAck)
    assert ack.result == d.MavResult.ACCEPTED
    assert len(bench.take(kind)) == 1


@pytest.mark.parametrize(
    ("number", "param1"),
    [(31_000, 0.0), *((512, odd) for odd in (float("nan"), -1.0, 1e30, 24.0))],
)
def test_an_unknown_command_is_unsupported(bench: Bench, number: int, param1: float) -> None:
    bench.hear(command(number, param1=param1), 255, 190)
    (ack,) = bench.take(d.CommandAck)
    assert (ack.command, ack.result) == (number, d.MavResult.UNSUPPORTED)
    assert (ack.target_system, ack.target_component) == (255, 190)


def test_a_tunnel_is_handed_over_with_its_sender_and_valid_bytes_only(bench: Bench) -> None:
    message = made.tunnel(
        0,
        b"\2\0\0\0rubbish".ljust(128, b"\0"),
        target_system=1,
        target_component=191,
        payload_length=4,
    )
    bench.hear(message, 245, 190)
    assert bench.tunnels == [(b"\2\0\0\0", Peer(245, 190))]


def test_a_tunnel_for_someone_else_or_too_long_is_counted_and_left(bench: Bench) -> None:
    ours = {"target_system": 1, "target_component": 191}
    bench.hear(made.tunnel(0, bytes(4), **ours | {"target_component": 25}), 255, 190)
    bench.hear(made.tunnel(0, bytes(128), **ours, payload_length=200), 255, 190)
    bench.hear(made.tunnel(5, bytes(4), **ours), 255, 190)  # a payload of another program
    assert bench.tunnels == []
    for name in ("for_others", "bad_tunnels", "tunnels_of_others"):
        assert bench.component.counters[name] == 1, name


def test_the_reports_of_one_radio_count_and_of_nobody_else(bench: Bench) -> None:
    def report(txbuf: int) -> d.RadioStatus:
        return d.RadioStatus(
            rssi=1, remrssi=1, txbuf=txbuf, noise=1, remnoise=1, rxerrors=0, fixed=0
        )

    bench.hear(report(90), 51, 68)
    for system_id in range(1, 200):  # a stranger of many names, a component and then a radio
        bench.hear(report(0), system_id, 195)
        bench.hear(report(1), 52, 68)
        bench.hear(report(2), 51, 68)
    assert bench.buffers == [90]
    bench.wait(1.0)
    bench.hear(report(80), 51, 68)
    assert bench.buffers == [90, 80]
    counters = bench.component.counters
    assert counters["radio_status_of_others"] == 2 * 199
    assert counters["radio_status_too_often"] == 199
    bench.wait(11.0)
    bench.hear(report(70), 52, 68)
    assert bench.buffers == [90, 80, 70], "the first is silent"


def test_it_says_what_it_waits_for(bench: Bench) -> None:
    assert bench.component.status(bench.now_ns) == "waiting for autopilot"
    bench.autopilot_heartbeat()
    assert bench.component.status(bench.now_ns) == "waiting for time"
    bench.fly(1)
    assert bench.component.status(bench.now_ns) == "waiting for ground station"
    bench.station_heartbeat()
    assert bench.component.status(bench.now_ns) == "ready"


def test_a_message_is_as_late_as_timesync_says(bench: Bench) -> None:
    bench.autopilot_heartbeat()
    assert bench.component.late_s(position(10_000), bench.now_ns) is None
    bench.fly(10)
    told = position(19_950)  # the last one of it
    assert bench.component.late_s(told, bench.now_ns) == pytest.approx(0.0, abs=0.06)
    late_ns = bench.now_ns + 700_000_000
    assert bench.component.late_s(told, late_ns) == pytest.approx(0.7, abs=0.06)
    heartbeat_of_it = heartbeat(d.MavType.QUADROTOR, d.MavAutopilot.PX4)
    assert bench.component.late_s(heartbeat_of_it, late_ns) is None


def test_what_the_autopilot_says_of_landing_is_kept_and_what_others_say_is_not() -> None:
    bench = Bench()
    state = d.MavLandedState
    bench.autopilot_heartbeat()
    assert bench.component.discovery.autopilot_landed is None
    for said, kept in ((state.ON_GROUND, True), (state.IN_AIR, False), (state.UNDEFINED, None)):
        bench.hear(d.ExtendedSysState(vtol_state=0, landed_state=said))
        assert bench.component.discovery.autopilot_landed is kept
    bench.hear(d.ExtendedSysState(vtol_state=0, landed_state=state.ON_GROUND), system_id=7)
    assert bench.component.discovery.autopilot_landed is None
