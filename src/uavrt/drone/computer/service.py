"""Install uavrt as a systemd service that starts at boot, with a udev rule for the radio.

The unit is ``Type=notify`` with a watchdog (systemd.service(5)). systemd restarts the
supervisor when it ends or stops reporting, and the supervisor resumes the flight. The service
may access only its directory, removable drives, USB radios, serial ports and the network
(systemd.exec(5)). The rule lets the group ``plugdev`` use the radio. Debian's own rule
(``TAG+="uaccess"``) admits only the user at the screen, not ssh and not a service.
"""

import pwd
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from uavrt.config.radios import RADIOS
from uavrt.core.atomic_file import write_atomically
from uavrt.core.errors import NotFound, UsageError
from uavrt.drone.computer.update import python_module

UNIT = "uavrt.service"
UNIT_PATH = Path("etc/systemd/system") / UNIT
WANTED_PATH = Path("etc/systemd/system/multi-user.target.wants") / UNIT
RULE_PATH = Path("etc/udev/rules.d/60-uavrt.rules")
UPDATE_UNIT_PATH = Path("etc/systemd/system/uavrt-update.service")
UPDATE_WANTED_PATH = Path("etc/systemd/system/multi-user.target.wants/uavrt-update.service")
WATCHDOG_S = 15
"""Time without a report after which systemd restarts the service [s]. Tuning FFTs at the start
may take 10 s."""

DRIVES = ("/media", "/run/media")
"""Directories where removable drives are mounted, for the command "save logs"."""
DEVICES = (
    "char-usb_device",
    "char-ttyUSB",
    "char-ttyACM",
    "char-ttyAMA",
    "char-ttyS",
    "char-ttyTHS",
)
"""Kernel names (``/proc/devices``) of USB radios and serial ports: USB cables, boards with a
USB port, and the pins of Raspberry Pi, PC and Jetson."""
_TEMPORARY = (Path("/tmp"), Path("/var/tmp"))
_HOMES = (Path("/home"), Path("/root"), Path("/run/user"))


@dataclass(frozen=True, slots=True, kw_only=True)
class ServicePlan:
    """Program, user, directories and settings file of the systemd service."""

    program: Path
    user: str
    directory: Path
    """Working directory; paths in the settings are relative to it."""
    config: Path | None = None
    """Settings file; None: ``uavrt.toml`` in the directory, if it exists."""
    writable: tuple[Path, ...] = ()
    """Directories outside of `directory` that the settings name, for flights and saved logs."""
    prefix: Path | None = None
    """Directory of versions (`uavrt.drone.computer.versions`); None: no updates."""


def unit_text(plan: ServicePlan) -> str:
    """Return the text of the service's systemd unit."""
    config = ["--config", str(plan.config)] if plan.config is not None else []
    command = " ".join(_quoted(word) for word in (str(plan.program), "run", *config))
    places = [str(plan.directory), *(str(path) for path in plan.writable)]
    # A missing directory must not prevent a flight.
    writable = " ".join(_place(place) for place in (*places, *DRIVES))
    devices = "\n".join(f"DeviceAllow={name} rw" for name in DEVICES)
    return f"""\
[Unit]
Description=uavrt: find radio-tagged animals from a drone
Documentation=man:systemd.service(5)
After=local-fs.target
# Restarts never stop: in the air it cannot be restarted by hand.
StartLimitIntervalSec=0

[Service]
Type=notify
NotifyAccess=main
ExecStart={command}
User={plan.user}
SupplementaryGroups=dialout plugdev
WorkingDirectory={_literal(plan.directory)}
Restart=always
RestartSec=0.5
WatchdogSec={WATCHDOG_S}
WatchdogSignal=SIGKILL
KillMode=mixed
TimeoutStartSec=30
TimeoutStopSec=20
OOMScoreAdjust=-500

# What it may touch: its own files, drives, radios, serial ports and the network.
UMask=0027
NoNewPrivileges=yes
CapabilityBoundingSet=
AmbientCapabilities=
ProtectSystem=strict
ReadWritePaths={writable}
ProtectHome={_home_access(plan)}
PrivateTmp=yes
DevicePolicy=closed
{devices}
ProtectKernelTunables=yes
ProtectKernelModules=yes
ProtectKernelLogs=yes
ProtectControlGroups=yes
ProtectClock=yes
ProtectHostname=yes
ProtectProc=invisible
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK
RestrictNamespaces=yes
RestrictRealtime=yes
RestrictSUIDSGID=yes
LockPersonality=yes
MemoryDenyWriteExecute=yes
RemoveIPC=yes
KeyringMode=private
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallFilter=~@privileged @resources
# Some processes lower their own priority; setpriv, which starts the radio, drops capabilities.
SystemCallFilter=setpriority capset
SystemCallErrorNumber=EPERM

[Install]
WantedBy=multi-user.target
"""


def update_unit_text(plan: ServicePlan, prefix: Path) -> str:
    """Return the unit that finishes the trial of a new version after a power cut."""
    config = ["--config", str(plan.config)] if plan.config is not None else []
    resume = ("uavrt.cli", "update", "--resume", "--prefix", str(prefix), *config)
    words = python_module(prefix / "trial", *resume)
    return f"""\
[Unit]
Description=uavrt: end the trial of a version that was interrupted
ConditionPathIsSymbolicLink={_literal(prefix / "trial")}
After={UNIT}

[Service]
Type=exec
ExecStart={" ".join(_quoted(word) for word in words)}
WorkingDirectory={_literal(plan.directory)}

[Install]
WantedBy=multi-user.target
"""


def check_plan(plan: ServicePlan, root: Path = Path("/")) -> None:
    """Raise `UsageError` for a service that could not start or would lose recordings.

    Refused are an unknown user, a missing directory, and a directory below /tmp.
    """
    if not root.is_dir():
        raise UsageError(f"{root} is not a directory", remedy="Check --root")
    users = root / "etc/passwd"
    if users.is_file():
        known = {line.split(":")[0] for line in users.read_text(errors="replace").splitlines()}
        if plan.user not in known and not (root == Path("/") and _has_account(plan.user)):
            raise NotFound(
                f"there is no user {plan.user}",
                remedy=f"Create it (sudo useradd --system {plan.user}), or give another --user",
            )
    if not (root / plan.directory.relative_to("/")).is_dir():
        raise NotFound(
            f"there is no directory {plan.directory}",
            remedy="Create it, owned by the service's user, or give another --directory",
        )
    program = (plan.program,) if root == Path("/") else ()
    for path in (*program, plan.directory, plan.config, *plan.writable):
        if path is not None and any(path.is_relative_to(place) for place in _TEMPORARY):
            raise UsageError(
                f"{path} is in a directory that the service cannot access and that is emptied "
                "at boot",
                remedy="Use a path in /var/lib, /opt or /home",
            )


def _has_account(user: str) -> bool:
    try:
        pwd.getpwnam(user)
    except KeyError:
        return False
    return True


def _literal(path: Path) -> str:
    """Return a path for the end of a unit's line, with ``%`` escaped for systemd."""
    return str(path).replace("%", "%%")


def _place(path: str) -> str:
    """Return a quoted path for ``ReadWritePaths=``, with ``%`` escaped for systemd."""
    return _quoted(f"-{path}").replace("$$", "$")


def _home_access(plan: ServicePlan) -> str:
    """Return the unit's line that hides home directories, unless the service needs one."""
    used = (plan.program, plan.directory, plan.config, *plan.writable)
    within = any(
        path.is_relative_to(home) for path in used if path is not None for home in _HOMES
    )
    return "read-only" if within else "yes"


def rule_text() -> str:
    """Text of the udev rule that gives the group ``plugdev`` access to USB radios."""
    lines = ["# uavrt: radios for the group plugdev, also over ssh and for services"]
    for vendor, product, name in (usb for row in RADIOS.values() for usb in row.usb):
        lines.append(f"# {name}")
        lines.append(
            f'SUBSYSTEM=="usb", ATTR{{idVendor}}=="{vendor}", ATTR{{idProduct}}=="{product}", '
            'MODE="0660", GROUP="plugdev"'
        )
    lines.append("# FTDI cable to the autopilot: a name that stays, no ModemManager")
    lines.append(
        'SUBSYSTEM=="tty", ATTRS{idVendor}=="0403", ATTRS{idProduct}=="6001", '
        'SYMLINK+="autopilot", ENV{ID_MM_DEVICE_IGNORE}="1"'
    )
    return "\n".join(lines) + "\n"


def _quoted(word: str) -> str:
    if any(c in word for c in "\n\r\0"):
        raise UsageError(f"{word!r} has a line break", remedy="Give a path or name without one")
    escaped = (
        word.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    )
    return f'"{escaped}"' if escaped != word or " " in word else word


def install(plan: ServicePlan, root: Path = Path("/")) -> list[str]:
    """Write the unit and the udev rule; start the service if `root` is ``/``.

    Returns a list of what was done.
    """
    done = [
        _write(root / UNIT_PATH, unit_text(plan)),
        _write(root / RULE_PATH, rule_text()),
        _link(root / WANTED_PATH, f"/{UNIT_PATH}"),
    ]
    if plan.prefix is not None:
        done.append(_write(root / UPDATE_UNIT_PATH, update_unit_text(plan, plan.prefix)))
        done.append(_link(root / UPDATE_WANTED_PATH, f"/{UPDATE_UNIT_PATH}"))
    if root == Path("/"):
        done += _call(
            ("udevadm", "control", "--reload"),
            ("udevadm", "trigger", "--subsystem-match=usb", "--subsystem-match=tty"),
            ("systemctl", "daemon-reload"),
            ("systemctl", "restart", UNIT),
        )
    return done


def remove(root: Path = Path("/")) -> list[str]:
    """Stop and remove the service but keep the flights; return a list of what was done.

    Raises `UsageError` if that is impossible.
    """
    done = _call(("systemctl", "stop", UNIT)) if root == Path("/") else []
    for path in (WANTED_PATH, UNIT_PATH, UPDATE_WANTED_PATH, UPDATE_UNIT_PATH, RULE_PATH):
        try:
            (root / path).unlink()
        except FileNotFoundError:
            continue
        except OSError as error:
            raise _not_allowed(root / path, error) from error
        done.append(f"removed {root / path}")
    if root == Path("/"):
        done += _call(("systemctl", "daemon-reload"), ("udevadm", "control", "--reload"))
    return done


def status(root: Path = Path("/")) -> list[str]:
    """Return lines of text: what is installed, and whether the service runs."""
    lines = [
        f"{'unit':<8}{_present(root / UNIT_PATH)}",
        f"{'at boot':<8}{'yes' if (root / WANTED_PATH).is_symlink() else 'no'}",
        f"{'rule':<8}{_present(root / RULE_PATH)}",
    ]
    if root == Path("/") and shutil.which("systemctl"):
        state = _output("systemctl", "is-active", UNIT)
        lines.append(f"{'state':<8}{state or 'unknown'}")
    return lines


def _present(path: Path) -> str:
    return str(path) if path.exists() else "not installed"


def _write(path: Path, text: str) -> str:
    try:
        if path.exists() and path.read_text(encoding="utf-8") == text:
            return f"{path} is up to date"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text)
    except OSError as error:
        raise _not_allowed(path, error) from error
    return f"wrote {path}"


def _link(path: Path, target: str) -> str:
    """Create the link `path` by which systemd starts a unit, as ``systemctl enable`` does."""
    try:
        if path.is_symlink() and str(path.readlink()) == target:
            return f"{path.name} starts at boot"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        path.symlink_to(target)
    except OSError as error:
        raise _not_allowed(path, error) from error
    return f"{path.name} will start at boot"


def _not_allowed(path: Path, error: OSError) -> UsageError:
    remedy = "Run it with sudo" if isinstance(error, PermissionError) else "Check --root"
    return UsageError(f"{path} cannot be written: {error.strerror}", remedy=remedy)


def _call(*commands: Sequence[str]) -> list[str]:
    said = []
    for command in commands:
        if shutil.which(command[0]) is None:
            said.append(f"{command[0]} is not installed: {' '.join(command)} was skipped")
            continue
        finished = subprocess.run(command, capture_output=True, text=True, check=False)
        if finished.returncode:
            said.append(f"{' '.join(command)} failed: {finished.stderr.strip()}")
    return said


def _output(*command: str) -> str:
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    return finished.stdout.strip()
