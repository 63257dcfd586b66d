"""The builds that are given, and how each is started with ports of its own."""

import hashlib
import os
import socket
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from uavrt.demo import free_udp_port
from uavrt.errors import LinkError, UsageError
from uavrt.simulation.flying import Flavour

PX4_BUILD = Path("build/px4_sitl_default")
PX4_GROUND_PORT, PX4_COMPANION_PORT, PX4_SENDS_TO = 18_570, 14_580, 14_540
"""Of instance 0: both of its links, and where the companion is expected. A ground station that
speaks first is answered."""
PX4_PORTS = (PX4_GROUND_PORT, PX4_COMPANION_PORT, PX4_SENDS_TO, 14_280, 13_030, 19_450)
"""All that an instance needs, by its number above these."""
PX4_PARAMETERS = {
    "SIM_BAT_MIN_PCT": 99,
    "NAV_DLL_ACT": 0,
    "COM_DISARM_PRFLT": 30,
    "SDLOG_MODE": -1,
}
"""The simulated battery stays full: SIH's is empty by half after a minute."""
ARDUCOPTER_PARAMETERS: dict[str, float] = {
    "DISARM_DELAY": 30,
    "SIM_BATT_CAP_AH": 0,
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
"""A quadrotor whose simulated sensors count as calibrated, with a battery that stays full."""
Place = tuple[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Started:
    """What starts an autopilot, and where its two links are."""

    command: tuple[str, ...]
    environment: Mapping[str, str] = field(default_factory=dict)
    ground: Place
    """Where the autopilot's link to a ground station listens; port 0: it speaks first."""
    companion: Place
    ground_port: int = 0
    """Where we listen for that link; 0: any port."""
    companion_port: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Build:
    """One autopilot's build.

    Parameters
    ----------
    name : str
        In tables.
    flavour : {"px4", "ardupilot"}
    program : Path
        What is run.
    simulated : bool
        It is our own simulated autopilot.
    """

    name: str
    flavour: Flavour
    program: Path
    simulated: bool = False

    def started(self, work: Path, home: tuple[float, float, float], scenario: Path) -> Started:
        """Choose free ports, and write what the autopilot reads.

        Parameters
        ----------
        work : Path
            Its own directory.
        home : (float, float, float)
            Latitude, longitude [deg] and altitude [m].
        scenario : Path
            World of the simulated autopilot.
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

    Raises
    ------
    UsageError
        There is none with the SIH simulator.
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
    """Check that a program can be started.

    Raises
    ------
    UsageError
        It is not there, or is no program.
    """
    if program.is_dir() or not os.access(program, os.X_OK):
        raise UsageError(
            f"{program} is not a program",
            remedy="Give ArduCopter's program for the board sitl, build/sitl/bin/arducopter",
        )
    return _build("ArduCopter SITL", "ardupilot", program)


def _build(kind: str, flavour: Flavour, program: Path) -> Build:
    """Name a build after its program's content: what another build flew is not its own."""
    with program.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return Build(name=f"{kind} {digest[:8]}", flavour=flavour, program=program.resolve())


def simulated_build(flavour: Flavour) -> Build:
    """Our own simulated autopilot, to compare with."""
    return Build(
        name=f"simulated {flavour}",
        flavour=flavour,
        program=Path(sys.executable),
        simulated=True,
    )


def free_instance() -> int:
    """Find a number of PX4 of which all ports are free; raises `LinkError`."""
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
