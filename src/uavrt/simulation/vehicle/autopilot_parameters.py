"""Parameters of the simulated autopilot that affect its links to the ground station.

Defaults are those of PX4 1.17 and ArduCopter 4.7. Nearly all changes take effect at a restart:
`active` contains the values at the last start.
"""

from collections.abc import Mapping

from uavrt.link.mavlink.dialect import MavParamType, ParamValue
from uavrt.link.mavlink.services.parameter_service import ParameterServer, Requests
from uavrt.simulation.vehicle.airframe import Flavour

COMPANION_PORT, GROUND_PORT = "companion", "ground"
PX4_DEFAULTS: dict[str, float] = {
    "MAV_0_CONFIG": 101,
    "MAV_0_MODE": 0,
    "MAV_0_FORWARD": 1,
    "MAV_1_CONFIG": 102,
    "MAV_1_MODE": 2,
    "MAV_1_FORWARD": 1,
    "MAV_2_CONFIG": 0,
    "MAV_2_MODE": 0,
    "MAV_2_FORWARD": 0,
    "SER_TEL1_BAUD": 57_600,
    "SER_TEL2_BAUD": 57_600,
    "NAV_DLL_ACT": 0,
    "MPC_XY_VEL_MAX": 12.0,
    "MIS_TAKEOFF_ALT": 2.5,
}
ARDUPILOT_DEFAULTS: dict[str, float] = {
    "SERIAL1_PROTOCOL": 2,
    "SERIAL1_BAUD": 57,
    "SERIAL1_OPTIONS": 0,
    "SERIAL2_PROTOCOL": 2,
    "SERIAL2_BAUD": 57,
    "SERIAL2_OPTIONS": 0,
    "SERIAL3_PROTOCOL": 5,
    "SERIAL3_BAUD": 230,
    "SERIAL3_OPTIONS": 0,
    "FS_GCS_ENABLE": 0,
    "MAV_GCS_SYSID": 255,
    "WPNAV_SPEED": 500.0,
}
_SIZES = {"PROTOCOL": MavParamType.INT8, "BAUD": MavParamType.INT32}


class AutopilotParameters:
    """Stored and active parameters of a simulated PX4 or ArduPilot, which answers requests."""

    def __init__(self, flavour: Flavour, changes: Mapping[str, float]) -> None:
        self._flavour = flavour
        defaults = PX4_DEFAULTS if flavour == "px4" else ARDUPILOT_DEFAULTS
        self.values = {**defaults, **changes}
        self.active = dict(self.values)
        self._server = ParameterServer(
            lambda: self.values,
            {name: _type_of(name) for name in self.values},
            bytewise=lambda: flavour == "px4",
        )

    def receive(self, request: Requests) -> list[ParamValue]:
        """Handle a parameter request and return the answers; any value is accepted."""
        answer = self._server.receive(request)
        if isinstance(answer, list):
            return answer
        self.values[answer.name] = answer.value
        return [self._server.value(answer.name)]

    def restart(self) -> None:
        """Make the stored values active, as a restart of the autopilot does."""
        self.active = dict(self.values)

    def passes_on(self, port: str) -> bool:
        """True if the autopilot forwards messages to and from a port."""
        number = 1 if port == GROUND_PORT else 2
        if self._flavour == "px4":
            return self.active[f"MAV_{number - 1}_FORWARD"] == 1
        mavlink2 = self.active[f"SERIAL{number}_PROTOCOL"] == 2
        return mavlink2 and not int(self.active[f"SERIAL{number}_OPTIONS"]) & 1 << 10


def _type_of(name: str) -> MavParamType:
    if name.startswith(("MPC_", "MIS_", "WPNAV_")):
        return MavParamType.REAL32
    if name.startswith("SERIAL"):
        return _SIZES.get(name.partition("_")[2], MavParamType.INT16)
    return MavParamType.INT32
