"""Parse reports from gpsd, the daemon that shares a GPS receiver: one JSON object per line.

The input is not trusted. A line is used only if it is complete, belongs to a known class, and
all its numbers are in range. Other lines are counted and skipped. Classes and fields are
described at https://gpsd.gitlab.io/gpsd/gpsd_json.html.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import msgspec
from msgspec import Meta

WATCH = b'?WATCH={"enable":true,"json":true};\n'
LONGEST = 10_240
"""Maximum length of a line from gpsd according to its manual [bytes]."""
_FIX_2D = 2


class _Line(msgspec.Struct, kw_only=True):
    """Fields that are read from one line of gpsd; all other fields are ignored."""

    kind: Annotated[str, Meta(max_length=20)] = msgspec.field(name="class")
    mode: int = 0
    lat: Annotated[float, Meta(ge=-90.0, le=90.0)] | None = None
    lon: Annotated[float, Meta(ge=-180.0, le=180.0)] | None = None
    altMSL: float | None = None  # noqa: N815 - gpsd's name
    alt: float | None = None
    heading: Annotated[float, Meta(ge=-360.0, le=360.0)] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsdReport:
    """Position and heading reported in one line of gpsd."""

    raw: bytes
    place: tuple[float, float] | None
    """Latitude and longitude of gpsd's position [°]; None without a fix."""
    altitude_amsl_m: float | None
    heading_deg: float | None
    """True heading from gpsd's compass [°]; None if there is no compass."""


class GpsdParser:
    """Extracts reports from gpsd's bytes and counts invalid lines."""

    def __init__(self) -> None:
        self._buffer = b""
        self._decoder = msgspec.json.Decoder(_Line)
        self.received = 0
        self.bad_crc = 0
        """Number of invalid lines; named as in all parsers of GPS data."""
        self.skipped_bytes = 0

    def feed(self, data: bytes) -> list[GpsdReport]:
        """Add bytes; return the reports of position or heading that are complete."""
        *lines, rest = (self._buffer + data).split(b"\n")
        if len(rest) > LONGEST:
            self.skipped_bytes += len(rest)
            rest = b""
        self._buffer = rest
        return [one for line in lines if line and (one := self._report(line)) is not None]

    def reset(self) -> None:
        """Discard an incomplete line, for example after a reconnection."""
        self.skipped_bytes += len(self._buffer)
        self._buffer = b""

    def _report(self, line: bytes) -> GpsdReport | None:
        try:
            read: Any = self._decoder.decode(line)
        except (msgspec.DecodeError, ValueError, RecursionError):
            self.bad_crc += 1
            return None
        if read.kind not in ("TPV", "ATT"):
            self.skipped_bytes += len(line)
            return None
        self.received += 1
        fixed = read.kind == "TPV" and read.mode >= _FIX_2D
        known = fixed and read.lat is not None and read.lon is not None
        altitude_m = read.alt if read.altMSL is None else read.altMSL
        finite = altitude_m is not None and math.isfinite(altitude_m)
        return GpsdReport(
            raw=line,
            place=(read.lat, read.lon) if known else None,
            altitude_amsl_m=altitude_m if finite else None,
            heading_deg=read.heading if read.kind == "ATT" else None,
        )
