"""Read radio frequency, sample rate and start time from a recording's file name.

The default names of these programs are recognized: SDR#
``SDRSharp_20150804_204121Z_145000000Hz_IQ``, HDSDR ``HDSDR_20130105_123456Z_14100kHz_RF`` and
gqrx ``gqrx_20200101_123456_145000000_1800000_fc``, with the time in UTC; SDR++
``baseband_145000000Hz_12-34-56_01-02-2023``, with the local time. airspy_rx and hackrf_transfer
(``-w``) write the local time although their names end it with Z. The names of rtl_433
(``g001_433.92M_250k``) have no time.
"""

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import PurePath
from typing import Final

from uavrt.core.units import NANOSECONDS_PER_SECOND

_DATE: Final = r"(?P<year>\d{4})(?P<month>\d\d)(?P<day>\d\d)"
_TIME: Final = r"(?P<hour>\d\d)(?P<minute>\d\d)(?P<second>\d\d)"
_NUMBER: Final = r"\d+(?:\.\d+)?"
_STAMPED: Final = rf"_{_DATE}_{_TIME}(?P<zulu>Z?)_(?P<frequency>{_NUMBER})(?P<unit>[kM]?)Hz"


@dataclass(frozen=True, slots=True, kw_only=True)
class NameFacts:
    """Values read from a file name; None for values that the name does not contain."""

    program: str
    center_frequency_hz: float | None = None
    frequency_step_hz: float | None = None
    """Step to which the file name rounds the frequency [Hz]; None if it is 1 Hz or less."""
    sample_rate_hz: float | None = None
    start_time_ns: int | None = None
    local_time: bool = False
    """True if the file name gives a local time, read in this computer's time zone."""
    format_name: str | None = None


@dataclass(frozen=True, slots=True)
class _Form:
    program: str
    pattern: re.Pattern[str]
    zulu_is_utc: bool = True
    format_name: str | None = None


_FORMS: Final = (
    _Form("SDR#", re.compile(rf"SDRSharp{_STAMPED}", re.ASCII)),
    _Form("HDSDR", re.compile(rf"HDSDR{_STAMPED}", re.ASCII)),
    _Form("airspy_rx", re.compile(rf"AirSpy(?:HF)?{_STAMPED}", re.ASCII), zulu_is_utc=False),
    _Form("hackrf_transfer", re.compile(rf"HackRF{_STAMPED}", re.ASCII), zulu_is_utc=False),
    _Form(
        "SDR++",
        re.compile(
            rf"baseband_(?P<frequency>{_NUMBER})(?P<unit>)Hz_"
            r"(?P<hour>\d\d)-(?P<minute>\d\d)-(?P<second>\d\d)_"
            r"(?P<day>\d\d)-(?P<month>\d\d)-(?P<year>\d{4})(?P<zulu>)",
            re.ASCII,
        ),
    ),
    _Form(
        "gqrx",
        re.compile(
            rf"gqrx_{_DATE}_{_TIME}_(?P<frequency>\d+)(?P<unit>)_(?P<rate>\d+)_fc", re.ASCII
        ),
        format_name="cf32",
    ),
    _Form(
        "rtl_433",
        re.compile(
            rf"g\d+_(?P<frequency>{_NUMBER})(?P<unit>M)_(?P<rate>{_NUMBER})(?P<rate_unit>k)",
            re.ASCII,
        ),
    ),
)
_FACTORS: Final = {"": 1.0, "k": 1e3, "M": 1e6}


def read_name(path: PurePath | str) -> NameFacts | None:
    """Read the values in a file name; None if no known program writes names of this form."""
    name = PurePath(path).name
    for form in _FORMS:
        if found := form.pattern.match(name):
            return _facts(form, found.groupdict())
    return None


def _facts(form: _Form, parts: dict[str, str | None]) -> NameFacts:
    factor = _FACTORS[parts.get("unit") or ""]
    rate = parts.get("rate")
    utc = form.program == "gqrx" or (bool(parts.get("zulu")) and form.zulu_is_utc)
    start_ns = _start_ns(parts, utc=utc) if parts.get("year") else None
    return NameFacts(
        program=form.program,
        center_frequency_hz=round(float(parts["frequency"] or 0.0) * factor, 3) or None,
        frequency_step_hz=_frequency_step_hz(form, parts["frequency"] or "", factor),
        sample_rate_hz=(
            float(rate) * _FACTORS[parts.get("rate_unit") or ""] or None if rate else None
        ),
        start_time_ns=start_ns,
        local_time=start_ns is not None and not utc,
        format_name=form.format_name,
    )


def _frequency_step_hz(form: _Form, number: str, factor: float) -> float | None:
    """Value of the last digit of the frequency in a file name [Hz]; None for 1 Hz or less.

    rtl_433 writes six digits and omits zeros at the end (format ``%g`` of C).
    """
    whole, _, decimals = number.partition(".")
    places = max(0, 6 - len(whole)) if form.program == "rtl_433" else len(decimals)
    step_hz: float = factor * 10.0**-places
    return step_hz if step_hz > 1.0 else None


def _start_ns(parts: dict[str, str | None], *, utc: bool) -> int | None:
    try:
        fields = [
            int(parts[name] or 0)
            for name in ("year", "month", "day", "hour", "minute", "second")
        ]
        stamp = datetime(*fields, tzinfo=UTC if utc else None)  # type: ignore[misc, arg-type]
        seconds = int(stamp.timestamp())
    except (ValueError, OverflowError, OSError):
        return None
    return seconds * NANOSECONDS_PER_SECOND if seconds >= 0 else None
