"""From the vehicle's pose to the antenna's: one rotation and one lever arm, applied once."""

import math
from dataclasses import dataclass, replace

from uavrt.config.settings import AntennaSettings
from uavrt.messages import Pose
from uavrt.pose.rotation import (
    IDENTITY,
    Quaternion,
    Vector,
    from_euler_deg,
    normalised,
    product,
    rotated,
)
from uavrt.units import wrap_degrees_180

# WGS 84 (NIMA TR8350.2): semi-major axis [m] and first eccentricity squared.
_SEMI_MAJOR_M = 6_378_137.0
_ECCENTRICITY_2 = 6.694_379_990_14e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Mounting:
    """How the antenna sits on the vehicle.

    Parameters
    ----------
    rotation : (w, x, y, z)
        Antenna frame to vehicle frame.
    offset_m : (forward, right, down)
        Antenna from the point whose position the autopilot tells [m].
    """

    rotation: Quaternion = IDENTITY
    offset_m: Vector = (0.0, 0.0, 0.0)

    @classmethod
    def from_settings(cls, settings: AntennaSettings) -> "Mounting":
        """Take the angles and lengths of ``[antenna]``."""
        return cls(
            rotation=from_euler_deg(
                settings.yaw_offset_deg, settings.pitch_offset_deg, settings.roll_offset_deg
            ),
            offset_m=(
                settings.offset_forward_m,
                settings.offset_right_m,
                settings.offset_down_m,
            ),
        )

    def antenna_pose(self, vehicle: Pose) -> Pose:
        """Get the antenna's pose from the vehicle's."""
        attitude = normalised(product(vehicle.quaternion_wxyz, self.rotation))
        if self.offset_m == (0.0, 0.0, 0.0):
            return replace(vehicle, quaternion_wxyz=attitude)
        north_m, east_m, down_m = rotated(vehicle.quaternion_wxyz, self.offset_m)
        latitude_deg, longitude_deg = _moved(vehicle, north_m, east_m)
        return replace(
            vehicle,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_amsl_m=vehicle.altitude_amsl_m - down_m,
            altitude_relative_m=vehicle.altitude_relative_m - down_m,
            quaternion_wxyz=attitude,
        )


def _moved(pose: Pose, north_m: float, east_m: float) -> tuple[float, float]:
    """Latitude and longitude after a few metres, by the ellipsoid's radii of curvature."""
    latitude_rad = math.radians(pose.latitude_deg)
    flattening = 1.0 - _ECCENTRICITY_2 * math.sin(latitude_rad) ** 2
    prime_vertical_m = _SEMI_MAJOR_M / math.sqrt(flattening) + pose.altitude_amsl_m
    meridian_m = (
        _SEMI_MAJOR_M * (1.0 - _ECCENTRICITY_2) / flattening**1.5 + pose.altitude_amsl_m
    )
    # At a pole a longitude means nothing; 1 m of its circle keeps the division finite.
    circle_m = max(prime_vertical_m * math.cos(latitude_rad), 1.0)
    latitude_deg = pose.latitude_deg + math.degrees(north_m / meridian_m)
    longitude_deg = pose.longitude_deg + math.degrees(east_m / circle_m)
    return max(-90.0, min(90.0, latitude_deg)), wrap_degrees_180(longitude_deg)
