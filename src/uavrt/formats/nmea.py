"""Parse NMEA 0183 sentences, and the positions and times in them.

The input is not trusted. A sentence is used only if it is complete, its checksum is correct,
and all its numbers are in range. Other sentences are counted and skipped.
"""

import re
from dataclasses import dataclass

from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s

BAUD = 9600
"""Default rate of the serial line to a GPS receiver [baud]."""
LONGEST = 120
"""Maximum length of an NMEA sentence [bytes]; receivers exceed the standard's 82."""
_PLACE = re.compile(r"(\d{2,3})([0-5]\d(?:\.\d{0,9})?)", re.ASCII)
_NUMBER = re.compile(r"-?\d{1,6}(?:\.\d{0,6})?", re.ASCII)
_QUALITIES = frozenset("1234579")
"""Accepted qualities of a GGA sentence; not 0 (no fix), 6 (extrapolated), 8 (simulator)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sentence:
    """A complete sentence with a correct checksum."""

    raw: bytes
    fields: tuple[str, ...]
    """Fields of the NMEA sentence; the first one is talker and kind, such as ``GPRMC``."""

    @property
    def place(self) -> tuple[float, float] | None:
        """Latitude and longitude [°]; None without a fix."""
        kind, fields = self.fields[0][-3:], self.fields
        try:
            if kind == "RMC" and fields[2] == "A":
                return place_in(fields[3:7])
            if kind == "GGA" and fields[6] in _QUALITIES:
                return place_in(fields[2:6])
            if kind == "GLL" and fields[6] == "A":
                return place_in(fields[1:5])
        except (ValueError, IndexError):
            pass
        return None

    @property
    def altitude_amsl_m(self) -> float | None:
        """Altitude above mean sea level in a GGA sentence [m]; None in other sentences."""
        if self.fields[0][-3:] != "GGA" or self.place is None:
            return None
        return _number(self.fields[9:10], -1000.0, 20_000.0)

    @property
    def heading_deg(self) -> float | None:
        """True heading of a compass [°] in HDT or a measured THS; None in other sentences."""
        kind, fields = self.fields[0][-3:], self.fields
        if kind == "HDT" or (kind == "THS" and fields[2:3] == ("A",)):
            return _number(fields[1:2], 0.0, 360.0)
        return None


class SentenceParser:
    """Extracts NMEA sentences from bytes and counts invalid ones."""

    def __init__(self) -> None:
        self._buffer = b""
        self.received = 0
        self.bad_crc = 0
        """Number of NMEA sentences with a wrong checksum or without one."""
        self.skipped_bytes = 0

    def feed(self, data: bytes) -> list[Sentence]:
        """Add bytes; return the sentences that are complete."""
        *lines, rest = (self._buffer + data).replace(b"\r", b"\n").split(b"\n")
        if len(rest) > LONGEST:
            self.skipped_bytes += len(rest)
            rest = b""
        self._buffer = rest
        return [one for line in lines if line and (one := self._sentence(line)) is not None]

    def reset(self) -> None:
        """Discard an incomplete sentence, for example after a reconnection."""
        self.skipped_bytes += len(self._buffer)
        self._buffer = b""

    def _sentence(self, line: bytes) -> Sentence | None:
        start = line.rfind(b"$")
        if start < 0 or len(line) - start > LONGEST or not line.isascii():
            self.skipped_bytes += len(line)
            return None
        text = line[start:].decode("ascii")
        fields = fields_of(text)
        if fields == [""] or "*" not in text:
            self.bad_crc += 1
            return None
        self.skipped_bytes += start
        self.received += 1
        return Sentence(raw=line[start:], fields=tuple(fields))


def _number(field: tuple[str, ...], least: float, most: float) -> float | None:
    if not field or _NUMBER.fullmatch(field[0]) is None:
        return None
    value = float(field[0])
    return value if least <= value <= most else None


def fields_of(line: str) -> list[str]:
    """Split a sentence into fields; ``[""]`` if the sentence or its checksum is invalid."""
    start = line.find("$")
    body, star, checksum = line[start + 1 :].strip().partition("*")
    if start < 0 or not body:
        return [""]
    if star:
        total = 0
        for byte in body.encode("ascii", "replace"):
            total ^= byte
        if f"{total:02X}" != checksum[:2].upper():
            return [""]
    return body.split(",")


def clock_ns(text: str) -> int:
    """Parse the time of day ``hhmmss.ss`` [ns]; raises `ValueError` if it is invalid."""
    hours, minutes, seconds = int(text[:2]), int(text[2:4]), float(text[4:])
    return (hours * 3600 + minutes * 60) * NANOSECONDS_PER_SECOND + ns_from_s(seconds)


def place_in(fields: list[str] | tuple[str, ...]) -> tuple[float, float]:
    """Parse ``ddmm.mmmm,N,dddmm.mmmm,E`` to latitude and longitude [°]; raises `ValueError`."""
    north, north_side, east, east_side = fields[:4]
    latitude = _degrees(north, 90.0)
    longitude = _degrees(east, 180.0)
    if north_side not in ("N", "S") or east_side not in ("E", "W"):
        raise ValueError("latitude needs N or S, longitude needs E or W")
    return (
        -latitude if north_side == "S" else latitude,
        -longitude if east_side == "W" else longitude,
    )


def _degrees(text: str, most: float) -> float:
    found = _PLACE.fullmatch(text)
    if found is None:
        raise ValueError(f"{text[:20]!r} is not an angle")
    value = int(found[1]) + float(found[2]) / 60.0
    if value > most:
        raise ValueError(f"the angle of {value:g} degrees is above {most:g} degrees")
    return value
