"""Read secret keys from files that only their owner may read."""

import os
import stat
from pathlib import Path

from uavrt.core.errors import ConfigError, os_errors_as
from uavrt.core.foreign import KEYS, read_file

REMEDY = "`(umask 077; openssl rand -hex 32 > FILE)` makes one"


def read_key_file(path: str | Path, what: str, *, least: int, most: int) -> bytes:
    """Read a secret key of `least` to `most` bytes, written as hexadecimal digits.

    Raises `ConfigError` if the file is unreadable or invalid, or if other users may read it.
    """
    with os_errors_as(ConfigError, f"cannot read the {what} {path}", REMEDY):
        text = read_file(path, KEYS).decode("ascii", "replace")
        # Windows stores permissions elsewhere.
        mode = os.stat(path).st_mode if os.name == "posix" else 0
    try:
        secret = bytes.fromhex(text.strip())
    except ValueError:
        secret = b""
    if not least <= len(secret) <= most:
        count = f"{2 * least}" if least == most else f"{2 * least} to {2 * most}"
        raise ConfigError(
            f"{path} is not a {what}: it must contain {count} hexadecimal digits", remedy=REMEDY
        )
    if stat.S_IMODE(mode) & 0o077:
        raise ConfigError(
            f"other users can read the {what} {path}", remedy=f"Run: chmod 600 {path}"
        )
    return secret
