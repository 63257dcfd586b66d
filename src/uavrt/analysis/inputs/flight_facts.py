"""Information that people add to a report: who flew which aircraft under which permit.

It is in ``report.toml`` in the flight's directory, or in the folder above it, so that one file
serves all flights of a season. docs/how-to/report-and-export.md has an example.
"""

import json
import tomllib
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

from uavrt.core.atomic_file import write_atomically
from uavrt.core.errors import ConfigError, os_errors_as
from uavrt.core.foreign import SETTINGS, check_toml, read_file
from uavrt.core.units import NANOSECONDS_PER_SECOND

NAME = "report.toml"
MOST_LETTERS = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFacts:
    """Fields of a report.toml; None for fields that are not set."""

    operator: str | None = None
    aircraft: str | None = None
    permit: str | None = None
    species: str | None = None
    time_zone: str | None = None
    altitude_datum: str | None = None

    @property
    def lines(self) -> tuple[str, ...]:
        """Lines printed below the report's title, such as the operator and the permit."""
        labelled = (
            ("Operator", self.operator),
            ("Aircraft", self.aircraft),
            ("Permit", self.permit),
            ("Species", self.species),
            ("Altitudes", self.altitude_datum),
        )
        return tuple(f"{name}: {text}" for name, text in labelled if text is not None)

    def local_time(self, time_ns: int) -> str | None:
        """Format the local time at the site; None without a time zone."""
        if self.time_zone is None:
            return None
        return f"{_utc(time_ns).astimezone(ZoneInfo(self.time_zone)):%Y-%m-%d %H:%M:%S %Z}"

    def clock(self, time_ns: int) -> str:
        """Time of day for a table: UTC, then local time if a time zone is set."""
        local = self.local_time(time_ns)
        utc = f"{_utc(time_ns):%H:%M:%S}"
        return utc if local is None else f"{utc} ({local.split()[1]})"

    def clock_in_words(self, time_ns: int) -> str:
        """Time of day for a sentence, followed by the names of its time zones."""
        local = self.local_time(time_ns)
        utc = f"{_utc(time_ns):%H:%M:%S} UTC"
        return utc if local is None else f"{utc} ({local.partition(' ')[2]})"

    def zones(self, time_ns: int) -> str:
        """Names of the time zones that `clock` prints, for a column heading."""
        local = self.local_time(time_ns)
        return "UTC" if local is None else f"UTC ({local.split()[2]})"


def facts_path(flight: Path) -> Path | None:
    """Path of the report.toml that applies to a flight or log; None if there is none."""
    inside = flight / NAME if flight.is_dir() else flight.parent / NAME
    return next((path for path in (inside, flight.parent / NAME) if path.is_file()), None)


def facts_of(flight: Path) -> ReportFacts:
    """Read a flight's report.toml. Raises `ConfigError` if it is damaged or wrong."""
    path = facts_path(flight)
    if path is None:
        return ReportFacts()
    return read_facts(path)


def read_facts(path: Path) -> ReportFacts:
    """Read one report.toml. Raises `ConfigError` if it is damaged or a field is wrong."""
    try:
        text = read_file(path, SETTINGS).decode()
        check_toml(text, SETTINGS)
        fields = tomllib.loads(text)
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"{path} cannot be read: {error}", remedy="Correct the file"
        ) from error
    return _judged(fields, path)


def write_facts(folder: Path, facts: ReportFacts) -> None:
    """Write a folder's report.toml, for flights without their own. Raises `ConfigError`."""
    path = folder / NAME
    fields = {name: text for name, text in asdict(facts).items() if text is not None}
    _judged(fields, path)
    # A string of JSON is one of TOML, too.
    written = {name: json.dumps(text, ensure_ascii=False) for name, text in fields.items()}
    lines = [f"{name} = {text}\n" for name, text in written.items()]
    with os_errors_as(ConfigError, f"cannot write {path}"):
        write_atomically(path, "".join(lines))


def _judged(entries: dict[str, Any], path: Path) -> ReportFacts:
    known = [field.name for field in fields(ReportFacts)]
    for name, text in entries.items():
        if name not in known:
            raise ConfigError(
                f"{path}: there is no field {name!r}", remedy=f"Choose from {', '.join(known)}"
            )
        if not isinstance(text, str) or len(text) > MOST_LETTERS or not text.isprintable():
            raise ConfigError(
                f"{path}: {name} is not text",
                remedy=f"Write at most {MOST_LETTERS} letters in quotation marks",
            )
    found = ReportFacts(**entries)
    try:
        found.local_time(0)
    except (OSError, ValueError, KeyError) as error:
        raise ConfigError(
            f"{path}: there is no time zone {found.time_zone!r}",
            remedy='Give a time zone such as "Europe/Zurich"; on Windows, '
            "run pip install tzdata",
        ) from error
    return found


def _utc(time_ns: int) -> datetime:
    return datetime.fromtimestamp(time_ns // NANOSECONDS_PER_SECOND, tz=UTC)
