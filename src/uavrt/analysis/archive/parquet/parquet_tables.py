"""Define, write and read the Parquet tables of a batch."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import quote

from uavrt.analysis.archive.parquet.seals import FileFingerprint, sealed
from uavrt.core.atomic_file import make_directories, replacing
from uavrt.core.errors import FormatError, needs_extra
from uavrt.core.messages import Pulse
from uavrt.flight.database.fields import fields_of
from uavrt.flight.integrated import IntegratedVerdict

if TYPE_CHECKING:
    import pyarrow as pa

SCHEMA_VERSION = "1"
PULSES, POSES, BEARINGS, POSITIONS = "pulses", "poses", "bearings", "positions"
INTEGRATED = "integrated"
RECORDINGS, FLIGHTS = "recordings.parquet", "flights.parquet"
PASSED_OVER, OUTLINES = "passed_over.parquet", "outlines.msgpack"
ROWS = "rows.json"
DONE, PLACED = "done", "placed"
MONTHS = "months"
PULSE_FIELDS = fields_of(Pulse)
_ROWS = 100_000
_PANDAS = {"whole": "Int64", "switch": "boolean"}
"""Nullable pandas types by kind of table column."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingRow:
    """Row of the table of recordings: one recording and the result of its search."""

    path: str
    """Path of the recording, or directory of a flight without a searched recording."""
    flight: str
    fingerprint: str
    state: str
    """``done``, ``truncated`` (damaged, searched up to the fault), ``failed`` (no pulse counts)
    or ``recorded`` (not searched: pulses as detected in flight)."""
    fault: str | None = None
    start_time_ns: int | None
    length_s: float | None = None
    """Duration of the recording's samples without lost samples [s]; None if unknown."""
    sample_rate_hz: float | None = None
    center_frequency_hz: float | None = None
    pulses: int
    confirmed: int
    lost_samples: int = 0
    invalid_values: int = 0
    cells: int = 0
    cpu_s: float = 0.0
    finished_time_ns: int
    uavrt_version: str
    beeps: str = ""
    """Descriptions of received signals that differ from the tag list, one per line."""
    input_faults: str = ""
    """Faults of the samples, such as a wrong gain or format, one per line."""
    tags_outside: tuple[int, ...] = ()
    """Ids of listed tags whose frequencies are outside the recording's band."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRow:
    """Row of the table of flights: one flight, the settings used and the faults found."""

    path: str
    """Directory of the flight, or path of a recording without a flight."""
    flight: str
    fingerprint: str
    state: str
    fault: str | None
    """Reason why the flight or some of its tags have no poses, bearings or positions."""
    start_time_ns: int | None
    steps: str
    antenna: str
    pulses: int
    pulses_with_pose: int
    clock_offset_s: float | None
    """Offset of the pulses' clock from the track's [s], positive if the former is ahead."""
    bearings: int
    positions: int
    cpu_s: float
    finished_time_ns: int
    uavrt_version: str
    dem: str | None = None
    """Elevation file or folder of the terrain; None for level ground."""
    integrate_fault: str | None = None
    """Reason why whole-flight analysis failed for some tags of the flight."""
    fingerprints: str = ""
    """Hash of each processing step's inputs, as STEP=HASH separated by commas."""
    copies: str = ""
    """Directories with copies of this flight, one per line; their data are in no table."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseRow:
    """Row of the table of poses: the antenna's pose at a pulse."""

    recording: str
    tag_id: int
    start_time_ns: int
    """Start of the pulse [ns]. Recording, tag and start together identify the pulse in the
    table of pulses."""
    time_ns: int
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    altitude_relative_m: float
    yaw_deg: float
    """Heading of the antenna's boresight, clockwise from true north [deg]."""
    quaternion_wxyz: tuple[float, float, float, float]
    extrapolated: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingOfTag:
    """Row of the table of bearings: one tag's bearing from one turn."""

    tag_id: int
    start_time_ns: int
    middle_time_ns: int
    end_time_ns: int
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    bearing_deg: float
    sigma_deg: float | None
    interval90_from_deg: float | None
    interval90_to_deg: float | None
    method: str
    pulses: int
    accepted: bool
    ambiguous: bool
    second_lobe_probability: float | None
    evidence: float | None
    reduced_chi2: float | None
    multipath_suspected: bool
    level_db: float | None
    fading_db: float | None
    confidence: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionOfTag:
    """Row of the table of positions: one tag's estimated position in one flight."""

    tag_id: int
    start_time_ns: int
    """Start of the first pulse used for the position [ns]."""
    end_time_ns: int
    latitude_deg: float
    longitude_deg: float
    method: str
    radius50_m: float | None
    radius95_m: float | None
    semi_major95_m: float | None
    semi_minor95_m: float | None
    orientation_deg: float | None
    bearings: int
    powers: int
    at_edge: bool
    heading_error_deg: float | None
    heading_error_sigma_deg: float | None
    remarks: str
    cautions: str
    """Names of the cautions on the tag's position, separated by commas."""
    cautions_in_words: str
    """Texts of the cautions for the operator, one per line."""
    track_time_ns: tuple[int, ...]
    track_latitude_deg: tuple[float, ...]
    track_longitude_deg: tuple[float, ...]
    track_radius50_m: tuple[float, ...]
    track_radius95_m: tuple[float, ...]


TABLES: dict[str, type] = {
    PULSES: Pulse,
    POSES: PoseRow,
    BEARINGS: BearingOfTag,
    POSITIONS: PositionOfTag,
    INTEGRATED: IntegratedVerdict,
}
"""Row type of each table that consists of one file per recording or flight."""

Row = TypeVar("Row")


def need_pyarrow() -> None:
    """Raise `UsageError` at a batch's start if the library for Parquet files is missing."""
    with needs_extra("batch", "A batch"):
        import pyarrow  # noqa: F401


def schema_of(record: type, *, flight: bool = False) -> "pa.Schema":
    """Parquet schema of a record type; times appear also as timestamps (``start_utc``).

    Pulses get additional columns for recording and cell; `flight` adds a column for the
    flight.
    """
    import pyarrow as pa

    types: dict[str, Any] = {
        "whole": pa.int64(),
        "real": pa.float64(),
        "switch": pa.bool_(),
        "word": pa.string(),
        "wholes": pa.list_(pa.int64()),
        "reals": pa.list_(pa.float64()),
    }
    described = fields_of(record)
    columns = [pa.field(one.name, types[one.kind], nullable=one.optional) for one in described]
    optional = {one.name: one.kind for one in described if one.optional}
    if record is Pulse:
        columns += [pa.field("recording", pa.string()), pa.field("cell", pa.int32())]
    if flight:
        columns.append(pa.field("flight", pa.string()))
    columns += [
        pa.field(f"{one.name.removesuffix('time_ns')}utc", pa.timestamp("us", "UTC"))
        for one in described
        if one.name.endswith("time_ns") and one.kind == "whole"
    ]
    kinds = {name: _PANDAS[kind] for name, kind in optional.items() if kind in _PANDAS}
    metadata = {"uavrt_schema": SCHEMA_VERSION, "pandas": _for_pandas(kinds)}
    return pa.schema(columns, metadata=metadata)


def _for_pandas(kinds: Mapping[str, str]) -> str:
    """Return metadata that make pandas use nullable types, so that columns keep their type in
    spite of nulls.

    See https://pandas.pydata.org/docs/development/developer.html.
    """
    columns = [
        {
            "name": name,
            "field_name": name,
            "metadata": None,
            "pandas_type": kind.lower().replace("boolean", "bool"),
            "numpy_type": kind,
        }
        for name, kind in kinds.items()
    ]
    return json.dumps({"index_columns": [], "column_indexes": [], "columns": columns})


def write_pulses(
    path: Path, pulses: Sequence[tuple[int, Pulse]], recording: str, flight: str
) -> FileFingerprint:
    """Write a table of pulses in the given order, each with the number of the piece of its
    recording (cell). Raises `OSError` if the file cannot be written.
    """
    more: dict[str, list[Any]] = {
        "recording": [recording] * len(pulses),
        "cell": [number for number, _ in pulses],
        "flight": [flight] * len(pulses),
    }
    return _write(path, Pulse, [pulse for _, pulse in pulses], more)


def write_rows(
    path: Path, record: type[Row], rows: Sequence[Row], flight: str | None = None
) -> FileFingerprint:
    """Write a table of records of one type; raises `OSError`."""
    more = {} if flight is None else {"flight": [flight] * len(rows)}
    return _write(path, record, rows, more)


def read_pulses(path: Path) -> Iterator[Pulse]:
    """Read a table of pulses; raises `FormatError` if the file is damaged."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = [one.name for one in PULSE_FIELDS]
    try:
        with pq.ParquetFile(path) as file:
            for batch in file.iter_batches(columns=names):
                yield from map(pulse_of, batch.to_pylist())
    except (OSError, pa.ArrowException) as error:
        raise FormatError(
            f"{path} cannot be read: {error}", remedy="Run the same command again"
        ) from error


def pulse_of(row: dict[str, Any]) -> Pulse:
    """Convert a table row to a pulse; columns that a pulse does not have are ignored."""
    values = {one.name: row[one.name] for one in PULSE_FIELDS if one.name in row}
    listed = {name: tuple(value) for name, value in values.items() if isinstance(value, list)}
    return Pulse(**(values | listed))


def _write(
    path: Path, record: type, rows: Sequence[Any], more: dict[str, list[Any]]
) -> FileFingerprint:
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = schema_of(record, flight="flight" in more)
    names = [one.name for one in fields_of(record)]
    make_directories(path.parent)
    with replacing(path) as part, pq.ParquetWriter(part, schema, compression="zstd") as writer:
        for begin in range(0, max(1, len(rows)), _ROWS):
            some = slice(begin, begin + _ROWS)
            columns = {
                name: [_plain(getattr(row, name)) for row in rows[some]] for name in names
            }
            columns |= {name: values[some] for name, values in more.items()}
            columns |= {
                one.name: _microseconds(columns[f"{one.name.removesuffix('utc')}time_ns"])
                for one in schema
                if one.name not in columns
            }
            writer.write_table(pa.table(columns, schema=schema))
    return sealed(path)


def _microseconds(times_ns: list[int | None]) -> list[int | None]:
    """Round times [ns] down to microseconds, the shortest unit of Python, R and Spark."""
    return [None if one is None else one // 1000 for one in times_ns]


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def encoded(text: str, also: str = "") -> str:
    """Percent-encode all characters except letters, digits, ``._-`` and those in `also`."""
    plain = f"._-{also}"
    return "".join(
        one if one.isalnum() or one in plain else quote(one, safe="") for one in text
    )
