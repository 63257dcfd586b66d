"""Attitudes as unit quaternions (scalar first), or as yaw, pitch and roll in this order.

A quaternion rotates vectors from the body frame (forward, right, down) to north, east, down.
Tuples are used because they are faster than arrays for single attitudes;
`uavrt.localization.headings` handles many headings at once. All values are in double precision.
"""

import math

from uavrt.core.units import wrap_degrees_360

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)


def normalised(q: Quaternion) -> Quaternion:
    """Scale a quaternion to length 1; raises `ValueError` if it is zero or not finite.

    A vehicle that does not know its attitude may send zeros.
    """
    length = math.hypot(*q)
    if not (1e-6 < length < math.inf):
        raise ValueError(f"the quaternion {q} is not a valid attitude")
    return (q[0] / length, q[1] / length, q[2] / length, q[3] / length)


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product of two quaternions: rotation by `b`, then by `a`."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def rotated(q: Quaternion, v: Vector) -> Vector:
    """Rotate a vector by an attitude `q`: from the body frame to north, east, down."""
    w, x, y, z = q
    conjugate = (w, -x, -y, -z)
    _, north, east, down = product(product(q, (0.0, *v)), conjugate)
    return (north, east, down)


def from_euler_deg(yaw_deg: float, pitch_deg: float, roll_deg: float) -> Quaternion:
    """Quaternion of yaw, pitch, roll [°] (intrinsic z, y', x''); NaN unless all are finite."""
    if not all(map(math.isfinite, (yaw_deg, pitch_deg, roll_deg))):
        return (math.nan,) * 4
    half_yaw, half_pitch, half_roll = (
        math.radians(angle) / 2.0 for angle in (yaw_deg, pitch_deg, roll_deg)
    )
    turn = (math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw))
    nose = (math.cos(half_pitch), 0.0, math.sin(half_pitch), 0.0)
    bank = (math.cos(half_roll), math.sin(half_roll), 0.0, 0.0)
    return product(product(turn, nose), bank)


def euler_deg(q: Quaternion) -> tuple[float, float, float]:
    """Yaw, pitch, roll [°] of an attitude, inverse of `from_euler_deg`; yaw in [-180, 180]."""
    w, x, y, z = q
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    return math.degrees(yaw), math.degrees(pitch), math.degrees(roll)


def yaw_deg(q: Quaternion) -> float:
    """Direction of the body's nose over ground [°], clockwise from true north, [0, 360)."""
    return wrap_degrees_360(euler_deg(q)[0])


def slerp(a: Quaternion, b: Quaternion, fraction: float) -> Quaternion:
    """Interpolate between two attitudes along the shorter arc, at a constant turning rate.

    `b` and `-b` are one attitude, and autopilots send either of them. A `fraction` outside [0,
    1] extrapolates the rotation. Shoemake, "Animating rotation with quaternion curves", 1985.
    """
    dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    sign = 1.0 if dot >= 0.0 else -1.0
    angle = math.acos(min(1.0, abs(dot)))
    if angle < 1e-6:  # chord and arc agree to 1e-12 here, and sin(angle) would divide noise
        weight_a, weight_b = 1.0 - fraction, fraction
    else:
        weight_a = math.sin((1.0 - fraction) * angle) / math.sin(angle)
        weight_b = math.sin(fraction * angle) / math.sin(angle)
    weight_b *= sign
    return normalised(
        (
            weight_a * a[0] + weight_b * b[0],
            weight_a * a[1] + weight_b * b[1],
            weight_a * a[2] + weight_b * b[2],
            weight_a * a[3] + weight_b * b[3],
        )
    )
