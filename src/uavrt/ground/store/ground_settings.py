"""Settings that the ground station keeps between runs, in its own directory."""

import contextlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, get_args

import msgspec

from uavrt.analysis.archive.parquet.questions import check_archive
from uavrt.config.parameters import check_start
from uavrt.config.tags.tag_corrections import TagCorrection, standing_corrections
from uavrt.config.tags.tag_files import write_tags
from uavrt.core.atomic_file import replacing, write_atomically
from uavrt.core.commands import Generation
from uavrt.core.errors import (
    ConfigError,
    FormatError,
    NotFound,
    UavrtError,
    UsageError,
    os_errors_as,
)
from uavrt.core.foreign import OWN, decode_record, read_file, read_record
from uavrt.core.messages import Tag
from uavrt.core.runtime.disk_thread import DiskBatches, DiskThread
from uavrt.core.units import number_in
from uavrt.formats.nmea import BAUD
from uavrt.ground.store.estimates import AntennaChoice
from uavrt.ground.store.tag_table import read_table
from uavrt.link.mavlink.links.address import parse_address
from uavrt.localization.antenna import MONOPOLE, PATTERNS
from uavrt.localization.position.tuning import COMMON, SURVEY
from uavrt.localization.terrain.elevation_files import open_elevation

MOST_JOBS = 256
"""Maximum number of writes queued while the disk does not answer: 16 for each of 16 vehicles.
"""
MOST_NAME = 40
"""Maximum number of letters of a vehicle's name, which the page shows in its header."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundSettings:
    """The ground station's settings, as the page shows them."""

    address: str = "udpin://127.0.0.1:14550"
    """One or several MAVLink addresses separated by spaces, the preferred one first."""
    generation: Generation = "G1"
    antenna: str = "RA-23K"
    antenna_offset_deg: float = 0.0
    heading_error_deg: float = COMMON.heading_sigma_deg
    """Error shared by all headings of a flight (compass, mounting, declination), one standard
    deviation [deg]; 0: none."""
    height_error_m: float = SURVEY.height_sigma_m
    """With a monopole: error shared by all heights above a tag, one standard deviation [m]."""
    gain: int | None = None
    """Radio gain in the radio's own steps; None: from the drone's own settings."""
    center_frequency_mhz: float | None = None
    """Centre frequency [MHz]; None: the drone's tuner chooses."""
    roaming_m: float = 10.0
    """Distance that an animal moves in a minute, one axis, one standard deviation [m].
    Positions become less certain with age as by a random walk; 0 for an animal at rest."""
    my_place: str = ""
    """Address of this computer's GPS receiver (NMEA); empty: no receiver."""
    vehicle_name: str = ""
    """The operator's name for the vehicle, shown with its number."""
    dem: str = ""
    """Elevation file or folder on this computer; empty: level ground is assumed."""
    archive: str = ""
    """Directory written by `uavrt batch`; empty: the folder `archive` among the flights."""
    left_out: tuple[int, ...] = ()
    """Ids of listed tags that the next flight does not search for."""

    @property
    def antenna_choice(self) -> AntennaChoice:
        """Antenna settings for the estimators."""
        return AntennaChoice(
            pattern=self.antenna,
            offset_deg=self.antenna_offset_deg,
            heading_sigma_deg=self.heading_error_deg,
            height_sigma_m=self.height_error_m,
            dem=self.dem,
        )

    def changed(self, values: Mapping[str, object]) -> "GroundSettings":
        """Return a copy with the page's changes; raises `UsageError` for an invalid value."""
        unknown = set(values) - set(asdict(self))
        if unknown:
            raise NotFound(f"there is no setting {sorted(unknown)[0][:40]!r}")
        return replace(
            self, **{name: _validated(name, value) for name, value in values.items()}
        )


_NEWEST_BYTES = 1_000_000
"""Bytes read from the end of the corrections file: some 2000 entries."""


class GroundStore:
    """Small files of the station: settings, tags, the current flight.

    A further vehicle's files are in ``vehicles/NUMBER``, written by the `first` store's thread.
    """

    def __init__(
        self, directory: Path, system_id: int | None = None, first: "GroundStore | None" = None
    ) -> None:
        self.disk: DiskThread = (
            DiskThread(MOST_JOBS, early=True) if first is None else first.disk
        )
        """Thread that writes all files of the station."""
        self.flights_begun: set[Path] = set() if first is None else first.flights_begun
        """Directories of flights of all vehicles that may not be on the disk yet."""
        self._soon = DiskBatches(self.disk, self._write_last, self._wrote)
        self.directory: Path = directory
        self.system_id: int | None = system_id
        self.own = directory if system_id is None else directory / "vehicles" / str(system_id)
        """Directory of this vehicle's small files and its record of received pulses."""
        with os_errors_as(
            ConfigError,
            f"cannot store flights in {directory}",
            "Give a writable directory with -o",
        ):
            self.own.mkdir(parents=True, exist_ok=True)
            (directory / "maps").mkdir(exist_ok=True)
        self._behind = False
        kept = self._read()
        current = kept.get("current_flight")
        self.current_flight: str | None = current if isinstance(current, str) else None
        # Only while a flight is in progress: tomorrow it may be another drone.
        self.vehicle: tuple[int | None, str | None] = (
            _vehicle(kept) if self.current_flight else (None, None)
        )
        """System id and unique number of the served vehicle; None without a flight."""
        self.further_vehicles = _numbers(kept.get("further_vehicles"))
        """MAVLink system ids of vehicles to serve in addition to the first."""
        page = kept.get("commander") if self.current_flight else None
        self.commander: str | None = page if isinstance(page, str) else None
        """Name of the commanding page, kept for a restart in flight; None without a flight."""
        self.settings = GroundSettings()
        settings = kept.get("settings")
        for name, value in settings.items() if isinstance(settings, dict) else ():
            with contextlib.suppress(UavrtError):
                self.settings = self.settings.changed({name: value})
        self.tags: tuple[Tag, ...] = read_table(self._tags_path)
        self.corrections: list[TagCorrection] = self._read_corrections()
        """Corrections of listed tags with the old values, the newest last."""

    def of_vehicle(self, system_id: int) -> "GroundStore":
        """Make the store of a further vehicle, which begins with these settings and tags."""
        known = (self.directory / "vehicles" / str(system_id)).exists()
        store = GroundStore(self.directory, system_id, self)
        if not known:
            store.set_settings(replace(self.settings, vehicle_name=""))
            store.set_tags(self.tags)
        return store

    @property
    def archive(self) -> Path | None:
        """Directory that `uavrt batch` wrote: from the settings, or among the flights; else
        None.
        """
        if self.settings.archive:
            return Path(self.settings.archive)
        usual = self.directory / "archive"
        return usual if usual.is_dir() else None

    @property
    def chosen_tags(self) -> tuple[Tag, ...]:
        """The tags that the next flight searches for."""
        return tuple(tag for tag in self.tags if tag.tag_id not in self.settings.left_out)

    @property
    def _tags_path(self) -> Path:
        return self.own / "tags.toml"

    @property
    def _corrections_path(self) -> Path:
        return self.own / "tag_corrections.jsonl"

    @property
    def log_path(self) -> Path:
        """Path of the operator's log, which covers all flights."""
        return self.own / "ground_log.jsonl"

    def set_tags(self, tags: tuple[Tag, ...]) -> None:
        """Replace the tag list, and write it to its file."""
        if tags:
            write_tags(self._tags_path, tags)
        else:
            self._tags_path.unlink(missing_ok=True)
        self.tags = tags

    def correct_tag(self, correction: TagCorrection) -> None:
        """Correct a listed tag and keep its old values; raises `ConfigError`, `OSError`."""
        tags = {tag.tag_id: tag for tag in self.tags}
        before = tags.get(correction.tag_id)
        if before is None:
            raise ConfigError(f"tag {correction.tag_id} is no longer listed")
        after = correction.applied(before)
        made = [*self.corrections, replace(correction, before=before, after=after)]
        with replacing(self._corrections_path) as part:
            # Both fit on the disk before either replaces what was there.
            part.write_bytes(b"".join(msgspec.json.encode(one) + b"\n" for one in made))
            self.set_tags(tuple((tags | {after.tag_id: after}).values()))
        self.corrections = made

    @property
    def corrections_listed(self) -> list[TagCorrection]:
        """Newest correction of each tag, if the tag list still has the corrected values."""
        last = {one.tag_id: one for one in standing_corrections(self.corrections)}
        return [
            last[tag.tag_id]
            for tag in self.tags
            if tag.tag_id in last and last[tag.tag_id].applied(tag) == tag
        ]

    def _read_corrections(self) -> list[TagCorrection]:
        """Read the corrections file; damaged lines are left out."""
        found = []
        with contextlib.suppress(OSError, FormatError):
            newest = read_file(self._corrections_path, OWN)[-_NEWEST_BYTES:]
            for line in filter(None, newest.splitlines()):
                with contextlib.suppress(FormatError):
                    found.append(decode_record(line, TagCorrection))
        return found

    def set_settings(self, settings: GroundSettings) -> None:
        """Replace the settings, and write them to their file."""
        self.settings = settings
        self._write()

    def set_flight(self, flight_id: str | None) -> None:
        """Store the name of the flight in progress, so that a restart can continue it."""
        self.current_flight = flight_id
        self._write_soon()

    def set_served(self, system_id: int | None, uid: str | None, page: str | None) -> None:
        """Store the served vehicle and commanding page if changed, or if a write had failed."""
        if self._behind or (self.vehicle, self.commander) != ((system_id, uid), page):
            self.vehicle, self.commander = (system_id, uid), page
            self._write_soon()

    def set_further_vehicles(self, numbers: tuple[int, ...]) -> None:
        """Store the system ids of the further vehicles."""
        self.further_vehicles = numbers
        self._write_soon()

    def _read(self) -> dict[str, Any]:
        try:
            return read_record(self.own / "ground.json", dict[str, Any])
        except (OSError, FormatError):
            return {}

    def _write_soon(self) -> None:
        """Write files without making an operator wait; retry if the disk refuses."""
        self._behind = True
        self._soon.waiting = [self._text()]
        self._soon.write()

    def _write_last(self, texts: list[str]) -> bool:
        try:
            for text in texts[-1:]:
                self._write_text(text)
        except ConfigError:
            return False
        return True

    def _wrote(self, texts: list[str], written: bool) -> None:
        self._behind = not written or texts != [self._text()]

    def _write(self) -> None:
        self._write_text(self._text())
        self._behind = False

    def _text(self) -> str:
        kept = {
            "settings": asdict(self.settings),
            "current_flight": self.current_flight,
            "vehicle": list(self.vehicle),
            "commander": self.commander,
            "further_vehicles": list(self.further_vehicles),
        }
        return json.dumps(kept, indent=1) + "\n"

    def _write_text(self, text: str) -> None:
        path = self.own / "ground.json"
        with os_errors_as(
            ConfigError,
            f"cannot write {path}",
            "Free space on the disk, or give a writable directory with -o",
        ):
            write_atomically(path, text)


def _numbers(kept: object) -> tuple[int, ...]:
    """Read a list of vehicle numbers and drop invalid ones."""
    if not isinstance(kept, list):
        return ()
    return tuple(one for one in kept if type(one) is int and 1 <= one <= 255)


def _vehicle(kept: dict[str, Any]) -> tuple[int | None, str | None]:
    match kept.get("vehicle"):
        case [int(system_id), str() | None as uid]:
            return system_id, uid
    return None, None


_RANGES = {
    "antenna_offset_deg": (-360.0, 360.0),
    "heading_error_deg": (0.0, 90.0),
    "height_error_m": (0.0, 1000.0),
    "roaming_m": (0.0, 1000.0),
}


def _validated(name: str, value: Any) -> Any:
    """Validate the value of a ground station's setting; return the value to store."""
    match name:
        case "address":
            addresses = [str(parse_address(text)) for text in str(value).split()]
            return " ".join(addresses) or str(parse_address(str(value)))
        case "my_place":
            return _receiver(str(value).strip())
        case "dem":
            return _readable(str(value).strip(), open_elevation)
        case "archive":
            return _readable(str(value).strip(), check_archive)
        case "vehicle_name" if isinstance(value, str) and len(value.strip()) <= MOST_NAME:
            return " ".join(value.split())
        case "generation" if value in get_args(Generation):
            return value
        case "antenna" if isinstance(value, str) and (value in PATTERNS or value == MONOPOLE):
            return value
        case _ if name in _RANGES:
            return _number(name, value, *_RANGES[name])
        case "left_out" if isinstance(value, list | tuple):
            if all(type(one) is int for one in value):
                return tuple(sorted(set(value)))
        case "gain" | "center_frequency_mhz" if value is None or value == "":
            return None
        case "gain":
            return check_start(None, None, number_in(str(value)))
        case "center_frequency_mhz":
            megahertz = number_in(str(value).replace(",", "."))
            check_start(None, megahertz * 1e6, None)
            return megahertz
    raise UsageError(f"{name} cannot have the value {str(value)[:40]!r}")


def _receiver(text: str) -> str:
    """Check the address of a GPS receiver; an empty one means no receiver."""
    try:
        return str(parse_address(text, baud=BAUD)) if text else ""
    except ConfigError as error:
        raise UsageError(
            f"{text[:60]!r} is not the address of a GPS receiver",
            remedy="Write the address as serial:///dev/ttyACM0, udpin://127.0.0.1:10110 or "
            "tcp://HOST:PORT",
        ) from error


def _readable(text: str, read: Callable[[Path], object]) -> str:
    """Check the path in a setting by reading from it; an empty path means none."""
    try:
        if text:
            read(Path(text))
    except FormatError as error:
        raise UsageError(error.message, remedy=error.remedy) from error
    return text and str(Path(text).absolute())


def _number(name: str, value: Any, low: float, high: float) -> float:
    number = number_in(str(value).replace(",", "."))
    if not low <= number <= high:
        raise UsageError(f"{name} must be a number from {low:g} to {high:g}")
    return number
