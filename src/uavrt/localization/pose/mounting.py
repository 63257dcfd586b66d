"""Convert the vehicle's pose to the antenna's pose by one rotation and one lever arm."""

from dataclasses import dataclass, replace

from uavrt.config.settings import AntennaSettings
from uavrt.core.earth.attitude import (
    IDENTITY,
    Quaternion,
    Vector,
    from_euler_deg,
    normalised,
    product,
    rotated,
)
from uavrt.core.earth.geodesy import moved
from uavrt.core.messages import Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class Mounting:
    """Orientation and position of the antenna on the vehicle.

    `rotation` (w, x, y, z) rotates from the antenna frame to the vehicle frame. `offset_m`
    (forward, right, down) is the antenna's position relative to the point whose position the
    autopilot reports [m].
    """

    rotation: Quaternion = IDENTITY
    offset_m: Vector = (0.0, 0.0, 0.0)

    @classmethod
    def from_settings(cls, settings: AntennaSettings) -> "Mounting":
        """Create the mounting from the angles and lengths in the settings' section
        ``[antenna]``.
        """
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
        """Convert a pose of the vehicle to the pose of the antenna."""
        attitude = normalised(product(vehicle.quaternion_wxyz, self.rotation))
        if self.offset_m == (0.0, 0.0, 0.0):
            return replace(vehicle, quaternion_wxyz=attitude)
        north_m, east_m, down_m = rotated(vehicle.quaternion_wxyz, self.offset_m)
        latitude_deg, longitude_deg = moved(
            *(vehicle.latitude_deg, vehicle.longitude_deg, vehicle.altitude_amsl_m),
            *(north_m, east_m),
        )
        return replace(
            vehicle,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_amsl_m=vehicle.altitude_amsl_m - down_m,
            altitude_relative_m=vehicle.altitude_relative_m - down_m,
            quaternion_wxyz=attitude,
        )
