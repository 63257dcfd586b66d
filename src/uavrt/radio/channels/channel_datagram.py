"""Encode and decode channel datagrams as the original channelizer sends them.

A datagram is a time stamp of 8 bytes and complex64 samples; layouts and ports: the manual's
reference of UDP formats. Read as floats, the stamp of style ``seconds`` is denormal for
nanoseconds below 2²³. So it is bytes here, because a copy that flushes denormals would lose it.
"""

import struct
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import FormatError
from uavrt.core.units import NANOSECONDS_PER_SECOND

StampStyle = Literal["seconds", "milliseconds"]
PortScheme = Literal["current", "thesis"]

SAMPLES: Final = 1024
"""Number of samples in one UDP datagram of the original channelizer."""
BYTES: Final = 8 * (1 + SAMPLES)
FIRST_PORT: Final = 20_000

_SECONDS: Final = struct.Struct("<II")
_MILLISECONDS: Final = struct.Struct("<ff")
_SPLIT: Final = 10_000_000
_NS_PER_MS: Final = 1_000_000
# Milliseconds since 1970 over 10⁷, from 2001 to 2065: such a float's bits, read as seconds
# of the other style, are times of 2007 to 2009.
_HIGH_RANGE: Final = (100_000.0, 300_000.0)


def encode_channel_datagram(
    samples: NDArray[np.complex64], time_ns: int, style: StampStyle = "seconds"
) -> bytes:
    """Encode a frame of samples; raises `ValueError` if the time stamp cannot hold its time."""
    try:
        if style == "seconds":
            stamp = _SECONDS.pack(*divmod(time_ns, NANOSECONDS_PER_SECOND))
        else:
            stamp = _MILLISECONDS.pack(*divmod(time_ns // _NS_PER_MS, _SPLIT))
    except struct.error:
        raise ValueError(f"{time_ns} ns does not fit a timestamp") from None
    return stamp + np.ascontiguousarray(samples, dtype="<c8").tobytes()


def decode_channel_datagram(
    payload: bytes, style: StampStyle | None = None
) -> tuple[int, NDArray[np.complex64]]:
    """Decode a frame: time of the first sample [ns, UTC] and a copy of the samples, (n,)."""
    if len(payload) < 16 or len(payload) % 8:
        raise FormatError(
            f"a datagram of {len(payload)} bytes does not consist of a time stamp and "
            "complex64 samples",
            remedy="Check that the port belongs to a channel, 20000 and up",
        )
    style = stamp_style(payload) if style is None else style
    if style == "seconds":
        seconds, nanoseconds = _SECONDS.unpack_from(payload)
        good = nanoseconds < NANOSECONDS_PER_SECOND
        time_ns = seconds * NANOSECONDS_PER_SECOND + nanoseconds
    else:
        high, low = _MILLISECONDS.unpack_from(payload)
        good = 0.0 <= high < 1e6 and 0.0 <= low < _SPLIT
        # Each half separately: their sum in nanoseconds does not fit a float64.
        time_ns = round(high * _SPLIT) * _NS_PER_MS + round(low * _NS_PER_MS) if good else 0
    if not good:
        raise FormatError(
            f"the first 8 bytes of a datagram, {payload[:8].hex()}, are not a time",
            remedy="Check that the port belongs to a channel, 20000 and up",
        )
    return time_ns, np.frombuffer(payload, "<c8", offset=8).astype(np.complex64)


def stamp_style(payload: bytes) -> StampStyle:
    """Detect the format of a frame's time stamp.

    The fraction of a `milliseconds` stamp is a float. If it is 1 ms or more, its bits, read as
    an integer, exceed 10⁹, which nanoseconds never do. If the fraction is 0, the other half of
    the stamp decides. This can be wrong only for stamps at a full second in the years 2007 to
    2009.
    """
    _, nanoseconds = _SECONDS.unpack_from(payload)
    high, _ = _MILLISECONDS.unpack_from(payload)
    if nanoseconds >= NANOSECONDS_PER_SECOND:
        return "milliseconds"
    plausible = _HIGH_RANGE[0] <= high <= _HIGH_RANGE[1] and float(high).is_integer()
    return "milliseconds" if nanoseconds == 0 and plausible else "seconds"


def channel_port(channel: int, scheme: PortScheme = "current", *, second: bool = False) -> int:
    """UDP port of a channel; `channel` is counted from 0, the channel at the radio's centre."""
    if second and scheme == "thesis":
        raise ValueError('the port scheme "thesis" has no second port for a channel')
    port = FIRST_PORT + (channel if scheme == "thesis" else 2 * channel + second)
    if not FIRST_PORT <= port < 65_536:
        raise ValueError(f"no UDP port exists for channel {channel}")
    return port
