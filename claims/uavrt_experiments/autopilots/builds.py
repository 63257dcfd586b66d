"""The autopilot builds under test, and their start with free ports."""

import hashlib
import os
import socket
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from uavrt.core.errors import LinkError, UsageError
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.vehicle.airframe import Flavour

PX4_BUILD = Path("build/px4_sitl_default")
PX4_GROUND_PORT, PX4_COMPANION_PORT, PX4_SENDS_TO = 18_570, 14_580, 14_540
"""UDP ports of PX4's instance 0: its links to ground stations and to the companion, and the
port to which it sends."""
PX4_PORTS = (PX4_GROUND_PORT, PX4_COMPANION_PORT, PX4_SENDS_TO, 14_280, 13_030, 19_450)
"""UDP ports that instance 0 binds; instance n binds each of them plus n."""
PX4_PARAMETERS = {
    "SIM_BAT_MIN_PCT": 99,
    "NAV_DLL_ACT": 0,
    "COM_DISARM_PRFLT": 30,
    "COM_DISARM_LAND": 10,
    "SDLOG_MODE": -1,
}
"""PX4's parameters for the simulation. SIH's battery is otherwise half empty after a minute.
After arming, SIH reports a flight and a landing for a moment; PX4 then disarms itself 2 s later
(COM_DISARM_LAND), sometimes in the middle of a take-off."""
ARDUCOPTER_PARAMETERS: dict[str, float] = {
    "DISARM_DELAY": 30,
    "SIM_BATT_CAP_AH": 0,
    "BATT_CAPACITY": 1_000_000,
    "FS_GCS_ENABLE": 0,
    "BATT_MONITOR": 4,
    "FRAME_CLASS": 1,
    "FRAME_TYPE": 0,
    **{
        f"COMPASS_OFS{n}_{axis}": value
        for n in ("", "2", "3")
        for axis, value in (("X", 5), ("Y", 13), ("Z", -18))
    },
    **{
        f"INS_ACC{n}{what}_{axis}": value
        for n in ("", "2")
        for what, value in (("OFFS", 0.001), ("SCAL", 1.001))
        for axis in "XYZ"
    },
}
"""Parameters of a quadrotor with calibrated simulated sensors and a battery that stays full."""
Place = tuple[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Started:
    """Command line of an autopilot, and the addresses of its links to ground and companion."""

    command: tuple[str, ...]
    environment: Mapping[str, str] = field(default_factory=dict)
    ground: Place
    """Address at which the autopilot's link to a ground station listens."""
    companion: Place
    ground_port: int = 0
    """Our UDP port on the link to the ground; 0 chooses a free one."""
    companion_port: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Build:
    """One autopilot build that is rehearsed.

    `name`: shown in tables; its flights' names begin with it.
    `program`: the autopilot's executable.
    `simulated`: true for uavrt's own simulated autopilot.
    """

    name: str
    flavour: Flavour
    program: Path
    simulated: bool = False

    def started(self, work: Path, home: tuple[float, float, float], scenario: Path) -> Started:
        """Choose free ports, and write the autopilot's start files.

        `work`: its working directory.
        `home`: latitude, longitude [deg] and altitude [m].
        `scenario`: world of the simulated autopilot.
        """
        if self.flavour == "px4" and not self.simulated:
            return self._px4(work, home)
        ports = free_udp_port(), free_udp_port()
        links = [f"127.0.0.1:{port}" for port in ports]
        if self.simulated:
            command: tuple[str, ...] = (
                *(sys.executable, "-P", "-m", "uavrt.simulation.autopilot"),
                *("--scenario", str(scenario), "--flavour", self.flavour),
                *("--ground", links[0], "--companion", links[1], "--flies", "--on-ground"),
            )
        else:
            defaults = work / "defaults.parm"
            lines = [f"{name} {value}\n" for name, value in ARDUCOPTER_PARAMETERS.items()]
            defaults.write_text("".join(lines))
            command = (
                *(str(self.program), "--model", "quad", "--speedup", "1", "--wipe"),
                *("--home", ",".join(f"{one}" for one in (*home, 0))),
                *("--instance", str(os.getpid() % 500 + 20), "--defaults", str(defaults)),
                *("--serial0", f"udpclient:{links[0]}", "--serial1", f"udpclient:{links[1]}"),
            )
        nowhere = ("127.0.0.1", 9)
        return Started(
            command=command,
            ground=nowhere,
            companion=nowhere,
            ground_port=ports[0],
            companion_port=ports[1],
        )

    def _px4(self, work: Path, home: tuple[float, float, float]) -> Started:
        number = free_instance()
        names = ("PX4_HOME_LAT", "PX4_HOME_LON", "PX4_HOME_ALT")
        parameters = {f"PX4_PARAM_{one}": str(v) for one, v in PX4_PARAMETERS.items()}
        top = self.program.parent.parent
        return Started(
            command=(
                *(str(self.program), "-d", str(top / "etc")),
                *("-i", str(number), "-w", str(work)),
            ),
            environment={
                "PX4_SIM_MODEL": "sihsim_quadx",
                **dict(zip(names, map(str, home), strict=True)),
                **parameters,
            },
            ground=("127.0.0.1", PX4_GROUND_PORT + number),
            companion=("127.0.0.1", PX4_COMPANION_PORT + number),
            companion_port=PX4_SENDS_TO + number,
        )


def px4_build(directory: Path) -> Build:
    """Find PX4 in the directory of its sources, or in that of its build.

    Raises `UsageError`: the directory has no build with the SIH simulator.
    """
    for top in (directory, directory / PX4_BUILD):
        program = top / "bin" / "px4"
        if program.is_file():
            airframes = top / "etc/init.d-posix/airframes"
            if not any(airframes.glob("*_sihsim_quadx")):
                raise UsageError(
                    f"{top} has no airframe sihsim_quadx",
                    remedy="Build the target px4_sitl_default, with the SIH simulator",
                )
            return _build("PX4 SIH", "px4", program)
    raise UsageError(
        f"{directory} holds no build of PX4: no bin/px4, there or in {PX4_BUILD}",
        remedy="Build the target px4_sitl_default, and give its directory",
    )


def arducopter_build(program: Path) -> Build:
    """Check that the given ArduCopter program can be started.

    Raises `UsageError`: the file does not exist, or is not executable.
    """
    if program.is_dir() or not os.access(program, os.X_OK):
        raise UsageError(
            f"{program} is not a program",
            remedy="Give ArduCopter's program for the board sitl, build/sitl/bin/arducopter",
        )
    return _build("ArduCopter SITL", "ardupilot", program)


def _build(kind: str, flavour: Flavour, program: Path) -> Build:
    with program.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return Build(name=f"{kind} {digest[:8]}", flavour=flavour, program=program.resolve())


def simulated_build(flavour: Flavour) -> Build:
    """Get uavrt's own simulated autopilot as a build, for comparison."""
    return Build(
        name=f"simulated {flavour}",
        flavour=flavour,
        program=Path(sys.executable),
        simulated=True,
    )


def free_instance() -> int:
    """Find an instance number of PX4 whose ports are all free; raises `LinkError`."""
    for number in range(9, 0, -1):
        if all(_is_free(port + number) for port in PX4_PORTS):
            return number
    raise LinkError(
        "the ports of all PX4 instances from 1 to 9 are in use",
        remedy="Stop other simulated autopilots",
    )


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        try:
            sock.bind(("", port))
        except OSError:
            return False
    return True
