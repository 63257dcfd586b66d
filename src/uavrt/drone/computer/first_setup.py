"""First set-up of a drone's computer: the steps of the system image's set-up page.

Each step is checked as a whole and written to ``uavrt.toml`` at once, so a power cut loses no
step. Values for root (hostname, passwords, update keys) go to ``set-up.conf`` in the same
directory. The image's start-up script ``uavrt-identity`` applies and removes them.
"""

import os
import re
import secrets
import socket
import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavrt.config.loader import load_settings
from uavrt.config.radios import RADIOS
from uavrt.config.setting_writer import change_settings
from uavrt.config.settings import Settings
from uavrt.core.atomic_file import write_atomically
from uavrt.core.errors import ConfigError, FormatError, NotFound, UsageError, os_errors_as
from uavrt.core.foreign import KEYS, read_file
from uavrt.core.messages import SystemStatus
from uavrt.drone.computer.computer_checks import check_autopilot, check_permissions, check_radio
from uavrt.drone.computer.finding import Finding
from uavrt.drone.computer.update_file import split_keys
from uavrt.drone.computer.versions import Installation
from uavrt.link.mavlink.links.address import parse_address
from uavrt.localization.antenna import PATTERNS
from uavrt.radio.receivers.devices import usb_radios

STEPS = ("name", "antenna", "radio", "autopilot", "keys")
DONE = "set-up-done"
"""Name of the file that marks the set-up as finished; it is next to the settings."""
HANDOVER = "set-up.conf"
UPDATE_KEYS = "update-keys.pem"
COMMAND_KEY = "command.key"
NAME = re.compile(r"[a-z0-9]([a-z0-9-]{0,30}[a-z0-9])?")
"""Pattern of a valid drone name: a hostname (RFC 1123) of at most 32 bytes, to serve as Wi-Fi
name."""
SECRET = re.compile(r"[A-Za-z0-9._-]{8,63}")
"""Pattern of a valid password: 8 to 63 characters for WPA, without characters that need
quoting."""
KEY = re.compile(r"(?:[0-9a-fA-F]{2}){16,256}")
SSH_KEY = re.compile(
    r"(?:ssh-(?:ed25519|rsa)|ecdsa-sha2-nistp256) [A-Za-z0-9+/]{60,1400}={0,2}"
    r"(?: [A-Za-z0-9@._-]{1,80})?"
)
"""Pattern of an SSH public key as written by ``ssh-keygen`` (sshd(8)), without options."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepFault:
    """Fault in a value that the user entered: the form field and the text to show."""

    field: str
    text: str


class FirstSetup:
    """The set-up steps and which are done. `config` is the drone's ``uavrt.toml``."""

    def __init__(self, config: Path) -> None:
        self.config = config
        self.done: set[str] = set()
        self._runs_with: str | None = None
        with suppress(ConfigError):
            self._runs_with = self._settings().mavlink.address

    @property
    def wanted(self) -> bool:
        """True while the set-up is unfinished."""
        return not (self.config.parent / DONE).exists()

    def values(self) -> dict[str, Any]:
        """Return the initial values of the form fields, without passwords and keys."""
        settings = self._settings()
        return {
            "name": self._handed_over().get("name") or socket.gethostname(),
            "antenna": settings.bearings.antenna,
            "yaw_offset_deg": settings.antenna.yaw_offset_deg,
            "kind": settings.radio.kind,
            "gain": settings.radio.gain,
            "sample_rate_msps": settings.radio.sample_rate_hz / 1e6,
            "bias_tee": settings.radio.bias_tee,
            "address": settings.mavlink.address,
            "command_key": settings.mavlink.key_file is not None,
            "update_key": self._has_update_key(),
        }

    def choices(self) -> dict[str, Any]:
        """Return the antennas and radios to choose from, and the radios now plugged in."""
        return {
            "antennas": list(PATTERNS),
            "radios": [
                {
                    "kind": row.kind,
                    "title": row.title,
                    "gains": row.gains,
                    "rate_msps": row.usual_rate_hz / 1e6,
                }
                for row in RADIOS.values()
            ],
            "plugged_in": sorted({radio.kind for radio in usb_radios()}),
        }

    def save_step(self, step: str, values: dict[str, Any]) -> tuple[StepFault, ...]:
        """Check the values of a step; write them if all are valid. Returns the faults found."""
        judge: dict[str, Callable[[dict[str, Any]], tuple[StepFault, ...]]] = {
            "name": self._name,
            "antenna": self._antenna,
            "radio": self._radio,
            "autopilot": self._autopilot,
            "keys": self._keys,
        }
        if step not in judge:
            raise NotFound(f"there is no step {step[:40]!r}")
        self._require_wanted()
        with _writing(self.config.parent):
            faults = judge[step](values)
        if not faults:
            self.done.add(step)
        return faults

    def test(self, step: str, running: SystemStatus | None) -> list[Finding]:
        """Test the radio or the autopilot's link with the saved settings, in some seconds."""
        self._require_wanted()
        settings = self._settings()
        if step == "radio":
            return [check_radio(settings, running)]
        if step != "autopilot":
            raise UsageError(f"there is nothing to test in the step {step[:40]!r}")
        allowed = check_permissions(settings)
        if not allowed.ok:
            return [allowed]
        # The drone side uses its own port and reports what it receives there.
        held = running if settings.mavlink.address == self._runs_with else None
        return [check_autopilot(settings, held)]

    def finish(self) -> dict[str, str]:
        """Finish the set-up; return the hostname. Raises `UsageError` if a step is missing."""
        self._require_wanted()
        missing = [step for step in STEPS if step not in self.done]
        if missing:
            raise UsageError(f"the set-up step {missing[0]} has not been completed")
        with _writing(self.config.parent):
            write_atomically(self.config.parent / DONE, "")
        return {"name": str(self.values()["name"])}

    def command_key(self) -> str:
        """Return the drone's command key for a laptop that will command it.

        Allowed only while the set-up is unfinished.
        """
        self._require_wanted()
        named = self._settings().mavlink.key_file
        if named is None:
            raise NotFound("there is no command key yet")
        return read_file(named, KEYS).decode("ascii", "replace").strip() + "\n"

    # ------------------------------------------------------------------- steps

    def _name(self, values: dict[str, Any]) -> tuple[StepFault, ...]:
        name = _text(values, "name")
        if not NAME.fullmatch(name):
            text = (
                "Enter 1 to 32 small letters, digits or hyphens; the name may not start "
                "or end with a hyphen"
            )
            return (StepFault(field="name", text=text),)
        self._hand_over(name=name)
        return ()

    def _antenna(self, values: dict[str, Any]) -> tuple[StepFault, ...]:
        faults = []
        antenna, turned = _text(values, "antenna"), _number(values, "yaw_offset_deg")
        if antenna not in PATTERNS:
            faults.append(StepFault(field="antenna", text="Choose an entry from the list"))
        if turned is None or not -360.0 <= turned <= 360.0:
            faults.append(
                StepFault(field="yaw_offset_deg", text="Enter an angle from -360° to 360°")
            )
        if not faults:
            self._change(
                {("bearings", "antenna"): antenna, ("antenna", "yaw_offset_deg"): turned}
            )
        return tuple(faults)

    def _radio(self, values: dict[str, Any]) -> tuple[StepFault, ...]:
        row = RADIOS.get(_text(values, "kind"))
        if row is None:
            return (StepFault(field="kind", text="Choose an entry from the list"),)
        faults = []
        gain, rate_msps = _number(values, "gain"), _number(values, "sample_rate_msps")
        left_out = values.get("gain") in (None, "")
        lowest, highest = row.gains
        if not left_out and (
            gain is None or not gain.is_integer() or not lowest <= gain <= highest
        ):
            text = f"Enter a whole number from {lowest} to {highest}, or leave this field empty"
            faults.append(StepFault(field="gain", text=text))
        if rate_msps is None or not row.takes_rate(round(rate_msps * 1e6, 3)):
            text = f"Enter a sample rate that the radio supports [MS/s]: {row.rates_text(1e6)}"
            faults.append(StepFault(field="sample_rate_msps", text=text))
        if faults or rate_msps is None:
            return tuple(faults)
        self._change(
            {
                ("radio", "kind"): row.kind,
                ("radio", "gain"): None if left_out or gain is None else int(gain),
                ("radio", "sample_rate_hz"): round(rate_msps * 1e6, 3),
                ("radio", "bias_tee"): values.get("bias_tee") is True,
            }
        )
        return ()

    def _autopilot(self, values: dict[str, Any]) -> tuple[StepFault, ...]:
        address = _text(values, "address")
        if address:
            try:
                parse_address(address)
            except ConfigError as error:
                return (StepFault(field="address", text=str(error)),)
        self._change({("mavlink", "address"): address})
        return ()

    def _keys(self, values: dict[str, Any]) -> tuple[StepFault, ...]:
        faults = []
        passwords = {name: _text(values, name) for name in ("page_password", "wifi_password")}
        for name, password in passwords.items():
            if password and not SECRET.fullmatch(password):
                text = (
                    "Enter 8 to 63 letters, digits, dots, hyphens or underscores, or "
                    "leave this field empty"
                )
                faults.append(StepFault(field=name, text=text))
        kept = _text(values, "command_key")
        if kept not in ("", "new") and not KEY.fullmatch(kept):
            text = "Enter 32 to 512 hexadecimal digits, or leave this field empty"
            faults.append(StepFault(field="command_key", text=text))
        pem = _text(values, "update_key")
        if pem and (len(pem) > 10_000 or not _are_public_keys(pem)):
            text = (
                "Enter an Ed25519 key that begins with -----BEGIN PUBLIC KEY-----, or "
                "leave this field empty"
            )
            faults.append(StepFault(field="update_key", text=text))
        elif pem and self._has_update_key():
            text = "this computer has keys already; an update changes them"
            faults.append(StepFault(field="update_key", text=text))
        ssh_key = " ".join(_text(values, "ssh_key").split())
        if ssh_key and not SSH_KEY.fullmatch(ssh_key):
            text = (
                "Enter one line that begins with ssh-ed25519, ssh-rsa or ecdsa-sha2, or "
                "leave this field empty"
            )
            faults.append(StepFault(field="ssh_key", text=text))
        elif ssh_key and self._login_keys().exists():
            text = "a maintainer's key exists already. Log in with it to change it"
            faults.append(StepFault(field="ssh_key", text=text))
        if faults:
            return tuple(faults)
        if kept:
            path = self.config.parent.resolve() / COMMAND_KEY
            key = secrets.token_hex(32) if kept == "new" else kept
            write_atomically(path, f"{key}\n", mode=0o600)
            self._change({("mavlink", "key_file"): str(path)})
        if pem:
            keys = "".join(split_keys(_lines(pem)))
            write_atomically(self.config.parent / UPDATE_KEYS, keys)
        handed = passwords | {"ssh_key": ssh_key}
        self._hand_over(**{name: one for name, one in handed.items() if one})
        return ()

    # ------------------------------------------------------------------- files

    def _settings(self) -> Settings:
        return load_settings(self.config) if self.config.exists() else Settings()

    def _change(self, changes: dict[tuple[str, str], Any]) -> None:
        change_settings(self.config, changes)

    def _require_wanted(self) -> None:
        if not self.wanted:
            raise UsageError(
                "this computer is already set up",
                remedy=f"Remove the file {DONE} next to the drone's settings to repeat the "
                "set-up",
            )

    def _handed_over(self) -> dict[str, str]:
        with suppress(OSError, ValueError, FormatError):
            text = read_file(self.config.parent / HANDOVER, KEYS).decode("ascii")
            return dict(line.split("=", 1) for line in text.splitlines())
        return {}

    def _hand_over(self, **values: str) -> None:
        whole = self._handed_over() | values
        text = "".join(f"{name}={value}\n" for name, value in sorted(whole.items()))
        write_atomically(self.config.parent / HANDOVER, text, mode=0o600)

    def _login_keys(self) -> Path:
        """Path of a system image's file of SSH login keys (deploy/image/configure-root.sh)."""
        return self.config.parent.resolve().parent / "ssh/authorized_keys"

    def _has_update_key(self) -> bool:
        installed = Installation.of(sys.executable)
        return installed is not None and installed.keys.exists()


def _writing(directory: Path) -> AbstractContextManager[None]:
    """Context that converts a disk error to a `ConfigError` with a remedy."""
    return os_errors_as(
        ConfigError,
        f"{directory} cannot be written",
        "Check with uavrt doctor whether the card is full or read-only",
    )


def _text(values: dict[str, Any], name: str) -> str:
    value = values.get(name, "")
    return value.strip() if isinstance(value, str) else ""


def _number(values: dict[str, Any], name: str) -> float | None:
    value = values.get(name)
    if isinstance(value, bool):
        return None
    try:
        return float(str(value).strip().replace(",", "."))
    except ValueError:
        return None


def _lines(pem: str) -> str:
    return "\n".join(line.strip() for line in pem.splitlines()) + "\n"


def _are_public_keys(pem: str) -> bool:
    """True if a text holds only Ed25519 public keys, which verify updates."""
    keys = split_keys(_lines(pem))
    return bool(keys) and "".join(keys) == _lines(pem) and all(map(_is_ed25519, keys))


def _is_ed25519(pem: str) -> bool:
    command = ["openssl", "pkey", "-pubin", "-noout", "-text"]
    environment = os.environ | {"LC_ALL": "C"}
    try:
        listed = subprocess.run(
            command, input=pem.encode(), capture_output=True, check=False, env=environment
        )
    except FileNotFoundError:
        raise UsageError(
            "openssl is not installed: keys cannot be checked",
            remedy="Run: sudo apt install openssl",
        ) from None
    return listed.returncode == 0 and listed.stdout.upper().startswith(b"ED25519")
