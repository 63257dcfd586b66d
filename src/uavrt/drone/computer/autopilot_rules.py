"""Autopilot parameters that uavrt needs to connect drone and ground.

PX4 (docs.px4.io, "Serial Port Configuration", "MAVLink Peripherals"): instance n of MAVLink
runs on the port MAV_n_CONFIG (0: off), sends the messages of MAV_n_MODE (2: onboard), and
forwards messages if MAV_n_FORWARD is 1. The port's rate is SER_<port>_BAUD. ArduPilot
(ardupilot.org, "Serial Port Configuration Options"): port n speaks SERIALn_PROTOCOL (2: MAVLink
2; TUNNEL does not exist in 1) at SERIALn_BAUD. It forwards nothing if bit 10 is set in
SERIALn_OPTIONS, since 2026 bit 1 of MAVn_OPTIONS. All take effect after a restart.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from uavrt.core.errors import ConfigError
from uavrt.link.mavlink.discovery import STATION_SYSTEM_ID

PX4_PORTS = {"TELEM1": (101, "TEL1"), "TELEM2": (102, "TEL2"), "TELEM3": (103, "TEL3")}
"""For each port of a PX4: value of MAV_n_CONFIG, and the port's name in SER_…_BAUD."""
ARDUPILOT_PORTS = {"TELEM1": 1, "TELEM2": 2, "TELEM3": 5}
"""For each port label on an ArduPilot board: usual number n of its SERIALn parameters; boards
differ."""
PX4_INSTANCES = (0, 1, 2)
ARDUPILOT_SERIALS = (1, 2, 3, 4, 5, 6)
ARDUPILOT_CHANNELS = (1, 2, 3, 4)
ONBOARD = 2
MAVLINK1, MAVLINK2 = 1, 2
NO_FORWARD = 1 << 10
NO_FORWARD_CHANNEL = 1 << 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Need:
    """An autopilot parameter: its reported value, its needed value, and the reason."""

    name: str
    value: float | None
    needed: float
    reason: str

    @property
    def met(self) -> bool:
        """True if the parameter has the needed value."""
        return self.value == self.needed


def serial_number(port: str) -> int:
    """Return n of SERIALn for a port such as ``TELEM2`` or ``SERIAL2``.

    Raises `ConfigError` for an unknown port.
    """
    number = port.removeprefix("SERIAL")
    if number.isdecimal() and int(number) in ARDUPILOT_SERIALS:
        return int(number)
    if port in ARDUPILOT_PORTS:
        return ARDUPILOT_PORTS[port]
    known = [*ARDUPILOT_PORTS, *(f"SERIAL{n}" for n in ARDUPILOT_SERIALS)]
    raise ConfigError(f"unknown port {port}", remedy=f"Choose from {', '.join(known)}")


def px4_port(port: str) -> tuple[int, str]:
    """Return the MAV_n_CONFIG value and the short name (``TEL2``) of a PX4 port.

    Raises `ConfigError` for an unknown port.
    """
    if port not in PX4_PORTS:
        raise ConfigError(f"unknown port {port}", remedy=f"Choose from {', '.join(PX4_PORTS)}")
    return PX4_PORTS[port]


def has_serial_ports(values: Mapping[str, float | None]) -> bool:
    """True if a PX4 has parameters for MAVLink on serial ports; a simulated PX4 has none."""
    return any(values.get(f"MAV_{n}_CONFIG") is not None for n in PX4_INSTANCES)


def operator_failsafe(px4: bool, values: Mapping[str, float | None]) -> tuple[bool, str, str]:
    """Check what the autopilot does if the ground station is lost; return (ok, text, remedy).

    PX4 counts every heartbeat of type GCS, ArduPilot those of the system MAV_GCS_SYSID
    (SYSID_MYGCS before 4.7); our ground stations send neither.
    """
    if px4:
        action = values.get("NAV_DLL_ACT")
        text = {None: "unknown", 0.0: "none"}.get(action, f"NAV_DLL_ACT = {action}")
        return True, f"action when the operator's ground station is lost: {text}", ""
    enabled = values.get("FS_GCS_ENABLE")
    operator = values.get("MAV_GCS_SYSID", None) or values.get("SYSID_MYGCS")
    if operator == STATION_SYSTEM_ID:
        text = f"the operator's ground station is system {operator:g}, as `uavrt ground` is"
        return False, f"{text}: its loss would go unnoticed", "Set MAV_GCS_SYSID to 255"
    text = {None: "unknown", 0.0: "none"}.get(enabled, f"FS_GCS_ENABLE = {enabled}")
    return True, f"action when the operator's ground station is lost: {text}", ""


def names_to_read(px4: bool, port: str | None) -> list[str]:
    """Names of the autopilot parameters that `needs` and `operator_failsafe` evaluate."""
    if px4:
        names = [
            f"MAV_{n}_{what}" for n in PX4_INSTANCES for what in ("CONFIG", "MODE", "FORWARD")
        ]
        names.append("NAV_DLL_ACT")
        return names if port is None else [*names, f"SER_{px4_port(port)[1]}_BAUD"]
    names = [f"SERIAL{n}_{w}" for n in ARDUPILOT_SERIALS for w in ("PROTOCOL", "OPTIONS")]
    names += [f"MAV{n}_OPTIONS" for n in ARDUPILOT_CHANNELS]
    names += ["FS_GCS_ENABLE", "MAV_GCS_SYSID", "SYSID_MYGCS"]
    return names if port is None else [*names, f"SERIAL{serial_number(port)}_BAUD"]


def needs(
    px4: bool, values: Mapping[str, float | None], port: str | None, baud: int
) -> list[Need]:
    """Compare the autopilot's parameters with the values that uavrt needs.

    Raises `ConfigError` for a port that cannot be used.
    """
    return _px4(values, port, baud) if px4 else _ardupilot(values, port, baud)


def _px4(values: Mapping[str, float | None], port: str | None, baud: int) -> list[Need]:
    found: list[Need] = []
    if not has_serial_ports(values):
        return found

    def need(name: str, needed: float, reason: str) -> None:
        found.append(Need(name=name, value=values.get(name), needed=needed, reason=reason))

    ours: int | None = None
    if port is not None:
        number, short = px4_port(port)
        ours = _instance_for(values, number, port)
        need(f"MAV_{ours}_CONFIG", number, f"to run MAVLink on {port}")
        need(
            f"MAV_{ours}_MODE",
            ONBOARD,
            "to get the attitude fifty times a second, for the poses",
        )
        need(f"SER_{short}_BAUD", baud, "to match the rate of our serial port")
    for n in PX4_INSTANCES:
        if n == ours or values.get(f"MAV_{n}_CONFIG"):
            reason = "to forward pulses" if n == ours else "to forward commands of the ground"
            need(f"MAV_{n}_FORWARD", 1, reason)
    return found


def _instance_for(values: Mapping[str, float | None], number: int, port: str) -> int:
    order = (1, 2, 0)
    on_port = [n for n in order if values.get(f"MAV_{n}_CONFIG") == number]
    free = [n for n in order if values.get(f"MAV_{n}_CONFIG") == 0]
    if not on_port and not free:
        raise ConfigError(
            f"no MAVLink instance is free for {port}",
            remedy="Set one of MAV_0_CONFIG, MAV_1_CONFIG, MAV_2_CONFIG to 0, or choose --port",
        )
    return (on_port or free)[0]


def _ardupilot(values: Mapping[str, float | None], port: str | None, baud: int) -> list[Need]:
    found: list[Need] = []

    def need(name: str, needed: float, reason: str) -> None:
        found.append(Need(name=name, value=values.get(name), needed=needed, reason=reason))

    ours = None if port is None else serial_number(port)
    if ours is not None:
        # ArduPilot's form: 57 is 57 600, 921 is 921 600, 1500 is 1 500 000.
        need(f"SERIAL{ours}_BAUD", baud // 1000, "to match the rate of our serial port")
    for n in ARDUPILOT_SERIALS:
        protocol = values.get(f"SERIAL{n}_PROTOCOL")
        if n != ours and protocol not in (MAVLINK1, MAVLINK2):
            continue
        need(f"SERIAL{n}_PROTOCOL", MAVLINK2, "because TUNNEL exists only in MAVLink 2")
        options = values.get(f"SERIAL{n}_OPTIONS")
        if options is not None:
            cleared = int(options) & ~NO_FORWARD
            need(f"SERIAL{n}_OPTIONS", cleared, "to forward messages")
    for n in ARDUPILOT_CHANNELS:
        options = values.get(f"MAV{n}_OPTIONS")
        if options is not None:
            cleared = int(options) & ~NO_FORWARD_CHANNEL
            need(f"MAV{n}_OPTIONS", cleared, "to forward messages")
    return found
