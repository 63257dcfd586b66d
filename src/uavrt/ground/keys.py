"""The secrets that a ground station shares with its drone."""

from dataclasses import dataclass
from pathlib import Path

from uavrt.mavlink.signing import SigningKey, read_signing_key
from uavrt.tunnel.seal import Key, read_key


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkKeys:
    """None, one or both."""

    command: Key | None = None
    """Seals commands inside their payload; also through PX4."""
    signing: SigningKey | None = None
    """Signs MAVLink frames."""


NO_KEYS = LinkKeys()


def read_link_keys(command: Path | None, signing: Path | None) -> LinkKeys:
    """Read the keys from their files; raises `ConfigError` for one that is none."""
    return LinkKeys(
        command=None if command is None else read_key(command),
        signing=None if signing is None else read_signing_key(signing),
    )
