"""What the ground station keeps between its runs, in its own directory."""

import contextlib
import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, get_args

from uavrt.config import write_tags
from uavrt.config.text_files import write_text_atomically
from uavrt.errors import ConfigError, UavrtError, UsageError
from uavrt.ground.estimates import AntennaChoice
from uavrt.ground.tag_table import read_table
from uavrt.localization import PATTERNS
from uavrt.mavlink.address import parse_address
from uavrt.messages import Tag
from uavrt.tunnel import Generation

MAX_GAIN = 21


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundSettings:
    """Set-up of the ground station, as the page shows it."""

    address: str = "udpin://127.0.0.1:14550"
    """One or several, the one to prefer first, with spaces between."""
    generation: Generation = "G1"
    antenna: str = "RA-23K"
    antenna_offset_deg: float = 0.0
    gain: int | None = None
    """None leaves the gain to the drone's own settings."""
    center_frequency_mhz: float | None = None
    """None lets the drone's tuner choose."""
    roaming_m: float = 10.0
    """How far an animal goes in a minute (one axis, one standard deviation), in steps that
    forget each other: positions grow by it with their age. 0 for one that rests."""
    left_out: tuple[int, ...] = ()
    """Numbers of tags in the table that are not flown with."""

    @property
    def antenna_choice(self) -> AntennaChoice:
        """For the estimators."""
        return AntennaChoice(pattern=self.antenna, offset_deg=self.antenna_offset_deg)

    def changed(self, values: object) -> "GroundSettings":
        """Take changes of the page.

        Raises
        ------
        UsageError
            A value is wrong; the text names it.
        """
        if not isinstance(values, dict):
            raise UsageError("settings must be an object")
        unknown = set(values) - set(asdict(self))
        if unknown:
            raise UsageError(f"there is no setting {sorted(unknown)[0][:40]!r}")
        return replace(self, **{name: _judged(name, value) for name, value in values.items()})


class GroundStore:
    """The directory's small files: settings, tags, the flight that goes on.

    Parameters
    ----------
    directory : Path
        Made when it is not there.

    Raises
    ------
    ConfigError
        It cannot be written.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        try:
            directory.mkdir(parents=True, exist_ok=True)
            (directory / "maps").mkdir(exist_ok=True)
        except OSError as error:
            raise ConfigError(
                f"cannot store flights in {directory}: {error.strerror}",
                remedy="Give a writable directory with -o",
            ) from error
        kept = self._read()
        self.current_flight: str | None = kept.get("current_flight")
        # Only while a flight goes on: tomorrow it may be another drone.
        self.vehicle = _vehicle(kept) if self.current_flight else (None, None)
        """System number and unique number of the vehicle that is served."""
        page = kept.get("commander") if self.current_flight else None
        self.commander: str | None = page if isinstance(page, str) else None
        """The page that commands."""
        self.settings = GroundSettings()
        for name, value in kept.get("settings", {}).items():
            with contextlib.suppress(UavrtError):
                self.settings = self.settings.changed({name: value})
        self.tags: tuple[Tag, ...] = read_table(self._tags_path)

    @property
    def chosen_tags(self) -> tuple[Tag, ...]:
        """The tags that are flown with."""
        return tuple(tag for tag in self.tags if tag.tag_id not in self.settings.left_out)

    @property
    def _tags_path(self) -> Path:
        return self.directory / "tags.toml"

    @property
    def log_path(self) -> Path:
        """The log of all flights together."""
        return self.directory / "ground_log.jsonl"

    def set_tags(self, tags: tuple[Tag, ...]) -> None:
        """Keep the tag list."""
        self.tags = tags
        if tags:
            write_tags(self._tags_path, tags)
        else:
            self._tags_path.unlink(missing_ok=True)

    def set_settings(self, settings: GroundSettings) -> None:
        """Keep the settings."""
        self.settings = settings
        self._write()

    def set_flight(self, flight_id: str | None) -> None:
        """Keep which flight goes on, for a restart."""
        self.current_flight = flight_id
        self._write()

    def set_served(self, system_id: int | None, uid: str | None, page: str | None) -> None:
        """Keep which vehicle is served and which page commands, for a restart in flight."""
        if (self.vehicle, self.commander) != ((system_id, uid), page):
            self.vehicle, self.commander = (system_id, uid), page
            self._write()

    def _read(self) -> dict[str, Any]:
        try:
            kept = json.loads((self.directory / "ground.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return kept if isinstance(kept, dict) else {}

    def _write(self) -> None:
        kept = {
            "settings": asdict(self.settings),
            "current_flight": self.current_flight,
            "vehicle": list(self.vehicle),
            "commander": self.commander,
        }
        path = self.directory / "ground.json"
        try:
            write_text_atomically(path, json.dumps(kept, indent=1) + "\n")
        except OSError as error:
            raise ConfigError(f"cannot write {path}: {error.strerror}") from error


def _vehicle(kept: dict[str, Any]) -> tuple[int | None, str | None]:
    match kept.get("vehicle"):
        case [int(system_id), str() | None as uid]:
            return system_id, uid
    return None, None


def _judged(name: str, value: Any) -> Any:
    """Judge one setting."""
    match name:
        case "address":
            addresses = [str(parse_address(text)) for text in str(value).split()]
            return " ".join(addresses) or str(parse_address(str(value)))
        case "generation" if value in get_args(Generation):
            return value
        case "antenna" if value in PATTERNS:
            return value
        case "antenna_offset_deg":
            return _number(name, value, -360.0, 360.0)
        case "roaming_m":
            return _number(name, value, 0.0, 1000.0)
        case "left_out" if isinstance(value, list | tuple):
            if all(type(one) is int for one in value):
                return tuple(sorted(set(value)))
        case "gain":
            if value is None or value == "":
                return None
            number = _number(name, value, 0, MAX_GAIN)
            if number == int(number):
                return int(number)
        case "center_frequency_mhz":
            if value is None or value == "":
                return None
            return _number(name, value, 20.0, 1000.0)
    raise UsageError(f"{name} cannot be {str(value)[:40]!r}")


def _number(name: str, value: Any, low: float, high: float) -> float:
    try:
        number = float(str(value).replace(",", "."))
    except ValueError:
        number = float("nan")
    if not low <= number <= high:
        raise UsageError(f"{name} must be a number from {low:g} to {high:g}")
    return number
