"""Poses against closed forms: constant-rate turns, straight lines, the date line."""

import math

import made
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from uavrt.config.settings import AntennaSettings
from uavrt.core.earth.attitude import (
    Quaternion,
    from_euler_deg,
    normalised,
    product,
    rotated,
    slerp,
)
from uavrt.core.errors import PoseUnavailable
from uavrt.core.messages import AttitudeSample, PositionSample, Pulse
from uavrt.core.units import wrap_degrees_180
from uavrt.localization.pose.attacher import PoseAttacher
from uavrt.localization.pose.ring import PoseRing

START_NS = 1_700_205_419_230_494_976

angles = st.floats(-180.0, 180.0)
attitudes = st.builds(from_euler_deg, angles, st.floats(-89.0, 89.0), angles)
axes = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 0.1)


def rotation_about(axis: tuple[float, float, float], angle_rad: float) -> Quaternion:
    length = math.hypot(*axis)
    x, y, z = (math.sin(angle_rad / 2) * part / length for part in axis)
    return (math.cos(angle_rad / 2), x, y, z)


def angle_between_deg(a: Quaternion, b: Quaternion) -> float:
    # By the vector part of the difference: acos of a number near 1 would lose half the digits.
    _, x, y, z = product((a[0], -a[1], -a[2], -a[3]), b)
    return math.degrees(2.0 * math.asin(min(1.0, math.hypot(x, y, z))))


def position(
    time_ns: int, longitude_deg: float = 8.5, latitude_deg: float = 47.4
) -> PositionSample:
    return PositionSample(
        time_ns=time_ns,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_amsl_m=488.0,
        altitude_relative_m=30.0,
    )


@given(attitudes, axes, st.floats(-3.1, 3.1), st.floats(0.0, 1.0))
def test_slerp_is_the_constant_rate_turn_between_two_attitudes(
    start: Quaternion, axis: tuple[float, float, float], angle_rad: float, fraction: float
) -> None:
    end = product(start, rotation_about(axis, angle_rad))
    expected = product(start, rotation_about(axis, fraction * angle_rad))
    found = slerp(start, end, fraction)
    assert math.isclose(math.hypot(*found), 1.0, abs_tol=1e-12)
    assert angle_between_deg(found, expected) < 1e-6


@given(attitudes, attitudes, st.floats(0.0, 1.0), st.booleans(), st.booleans())
def test_the_sign_of_a_quaternion_changes_nothing(
    start: Quaternion, end: Quaternion, fraction: float, flip_start: bool, flip_end: bool
) -> None:
    # Exactly opposite attitudes have no shorter arc, and either is right.
    assume(abs(angle_between_deg(start, end) - 180.0) > 1e-3)

    def flipped(q: Quaternion, flip: bool) -> Quaternion:
        return (-q[0], -q[1], -q[2], -q[3]) if flip else q

    found = slerp(flipped(start, flip_start), flipped(end, flip_end), fraction)
    assert angle_between_deg(found, slerp(start, end, fraction)) < 1e-5


@given(
    rate_deg_s=st.sampled_from([-60.0, -30.0, 5.0, 30.0, 60.0]),
    interval_ns=st.integers(5_000_000, 500_000_000),
    offset=st.floats(0.0, 1.0),
    flips=st.lists(st.booleans(), min_size=200, max_size=200),
)
@settings(max_examples=30)
def test_the_ring_gives_the_analytic_heading_of_a_steady_turn(
    rate_deg_s: float, interval_ns: int, offset: float, flips: list[bool]
) -> None:
    ring = PoseRing()
    for index, flip in enumerate(flips):
        time_ns = START_NS + index * interval_ns
        q = from_euler_deg(rate_deg_s * index * interval_ns / 1e9, 3.0, -2.0)
        signed = (-q[0], -q[1], -q[2], -q[3]) if flip else q
        ring.add_attitude(AttitudeSample(time_ns=time_ns, quaternion_wxyz=signed))
        ring.add_position(position(time_ns))
    elapsed_ns = round((len(flips) - 1) * interval_ns * offset)
    pose = ring.antenna_pose(START_NS + elapsed_ns)
    expected = from_euler_deg(rate_deg_s * elapsed_ns / 1e9, 3.0, -2.0)
    # Yaw of a banked vehicle is not the arc's parameter: 60°/s × 0.5 s leaves 0.2° at most.
    assert angle_between_deg(pose.quaternion_wxyz, expected) < 0.25
    assert not pose.extrapolated


@given(
    west=st.floats(-180.0, 179.999), step_deg=st.floats(-1.0, 1.0), fraction=st.floats(0.0, 1.0)
)
def test_a_flight_over_the_date_line_stays_on_its_short_way(
    west: float, step_deg: float, fraction: float
) -> None:
    ring = PoseRing()
    second_ns = 1_000_000_000
    for time_ns, longitude in ((0, west), (second_ns, wrap_degrees_180(west + step_deg))):
        at = START_NS + time_ns
        ring.add_position(position(at, longitude))
        ring.add_attitude(AttitudeSample(time_ns=at, quaternion_wxyz=(1.0, 0.0, 0.0, 0.0)))
    elapsed_ns = round(fraction * second_ns)
    pose = ring.antenna_pose(START_NS + elapsed_ns)
    assert -180.0 <= pose.longitude_deg < 180.0
    away = wrap_degrees_180(pose.longitude_deg - west - step_deg * elapsed_ns / second_ns)
    assert abs(away) < 1e-9


@given(attitudes, angles, st.floats(-90, 90), angles, st.tuples(*[st.floats(-20, 20)] * 3))
def test_the_mounting_is_applied_once_and_loses_no_length(
    attitude: Quaternion,
    yaw: float,
    pitch: float,
    roll: float,
    offset_m: tuple[float, float, float],
) -> None:
    ring = PoseRing(
        AntennaSettings(
            yaw_offset_deg=yaw,
            pitch_offset_deg=pitch,
            roll_offset_deg=roll,
            offset_forward_m=offset_m[0],
            offset_right_m=offset_m[1],
            offset_down_m=offset_m[2],
        )
    )
    ring.add_attitude(AttitudeSample(time_ns=START_NS, quaternion_wxyz=attitude))
    ring.add_position(position(START_NS))
    vehicle, antenna = ring.vehicle_pose(START_NS), ring.antenna_pose(START_NS)
    expected = product(attitude, from_euler_deg(yaw, pitch, roll))
    assert angle_between_deg(antenna.quaternion_wxyz, expected) < 1e-9
    # Length of a degree by the usual series in multiples of the latitude (another formula
    # than ours), 47.4°: 111 178.6 m and 75 486.4 m; both grow by 488/6.37e6 with altitude.
    scale = 1.0 + 488.0 / 6.37e6
    north = (antenna.latitude_deg - vehicle.latitude_deg) * 111_178.6 * scale
    east = (antenna.longitude_deg - vehicle.longitude_deg) * 75_486.4 * scale
    down = vehicle.altitude_amsl_m - antenna.altitude_amsl_m
    for found, true in zip((north, east, down), rotated(attitude, offset_m), strict=True):
        assert abs(found - true) < 0.001
    assert math.isclose(
        antenna.altitude_relative_m - vehicle.altitude_relative_m, -down, abs_tol=1e-9
    )


@given(st.tuples(*[st.floats(-10, 10)] * 4).filter(lambda q: math.hypot(*q) > 0.01))
def test_any_attitude_that_is_one_comes_out_with_length_one(q: Quaternion) -> None:
    ring = PoseRing()
    ring.add_attitude(AttitudeSample(time_ns=START_NS, quaternion_wxyz=q))
    ring.add_position(position(START_NS))
    pose = ring.antenna_pose(START_NS)
    assert math.isclose(math.hypot(*pose.quaternion_wxyz), 1.0, abs_tol=1e-12)
    assert angle_between_deg(pose.quaternion_wxyz, normalised(q)) < 1e-9


events = st.lists(
    st.tuples(st.sampled_from(["attitude", "position", "pulse", "ready"]), st.integers(0, 400)),
    max_size=80,
)


@given(events, st.floats(0.0, 2.0))
def test_no_pulse_is_ever_lost_doubled_or_out_of_its_tags_order(
    steps: list[tuple[str, int]], wait_s: float
) -> None:
    ring = PoseRing()
    attacher = PoseAttacher(ring, wait_s=wait_s)
    now_ns = START_NS
    given_in: dict[int, list[int]] = {2: [], 4: []}
    came_out: dict[int, list[int]] = {2: [], 4: []}
    for number, (kind, delay_ms) in enumerate(steps):
        now_ns += delay_ms * 1_000_000
        if kind == "attitude":
            ring.add_attitude(AttitudeSample(time_ns=now_ns, quaternion_wxyz=(1, 0, 0, 0)))
        elif kind == "position":
            ring.add_position(position(now_ns))
        elif kind == "pulse":
            tag_id = 2 if delay_ms % 2 else 4
            given_in[tag_id].append(number)
            attacher.add(pulse(tag_id, now_ns - delay_ms * 3_000_000, number), now_ns)
        else:
            for released in attacher.ready(now_ns):
                came_out[released.pulse.tag_id].append(released.pulse.group_sequence)
            deadline_ns = attacher.next_deadline_ns()
            assert deadline_ns is None or deadline_ns > now_ns
    for released in attacher.flush():
        came_out[released.pulse.tag_id].append(released.pulse.group_sequence)
    assert came_out == given_in
    assert len(attacher) == 0
    counted = attacher.attached + attacher.extrapolated + attacher.without_pose
    assert counted == sum(map(len, given_in.values()))


@given(st.lists(st.integers(-(10**10), 10**10), max_size=60))
def test_times_in_any_order_never_break_the_ring(times_ns: list[int]) -> None:
    ring = PoseRing(capacity=10)
    for time_ns in times_ns:
        ring.add_attitude(AttitudeSample(time_ns=time_ns, quaternion_wxyz=(1, 0, 0, 0)))
        ring.add_position(position(time_ns))
    for time_ns in times_ns:
        try:
            pose = ring.antenna_pose(time_ns, extrapolate=True)
        except PoseUnavailable:
            continue
        assert abs(pose.latitude_deg - 47.4) < 1e-9
    for time_ns in (10**12, 10**12 + 10**8):
        ring.add_attitude(AttitudeSample(time_ns=time_ns, quaternion_wxyz=(1, 0, 0, 0)))
        ring.add_position(position(time_ns))
    pose = ring.antenna_pose(10**12 + 5 * 10**7, extrapolate=False)
    assert abs(pose.latitude_deg - 47.4) < 1e-9


def pulse(tag_id: int, start_time_ns: int, sequence: int) -> Pulse:
    return made.pulse(
        start_time_ns,
        tag_id=tag_id,
        group_sequence=sequence,
        detection_status="detected",
        confirmed=False,
    )
