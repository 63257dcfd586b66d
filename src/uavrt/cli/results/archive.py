"""``uavrt archive``: query and export all flights of an archive made by ``uavrt batch``."""

import json
import sys
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from uavrt.cli.examples import examples
from uavrt.cli.shown.outputs import check_place, print_json
from uavrt.core.errors import ConfigError

if TYPE_CHECKING:
    import pyarrow as pa

WIDE = 10_000
_ROWS = 10_000
"""Number of an archive's rows that are converted at once, in some hundredths of a second."""
_PLACES = ("latitude_deg", "longitude_deg")

archive = App(
    name="archive",
    help="Query all recordings that uavrt batch has searched. Needs uavrt[batch].",
)
AsJson = Annotated[bool, Parameter(name="--json", negative="")]


def _ready(name: str, what: str) -> None:
    def command(directory: Path, *, as_json: AsJson = False) -> None:
        from uavrt.analysis.archive.parquet.questions import QUESTIONS, ask

        _print(ask(directory, QUESTIONS[name]), as_json)

    command.__doc__ = f"""{what}

    Parameters
    ----------
    directory
        Directory that uavrt batch wrote.
    as_json
        Print one JSON object per line.
    """
    archive.command(command, name=name, help_epilogue=examples(f"archive {name}"))


_ready("list", "List the recordings, and what was done with each.")
_ready("tags", "List the tags: pulses, flights, first and last time, strength, frequency.")


@archive.command(help_epilogue=examples("archive query"))
def query(
    directory: Path,
    sql: str,
    *,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    overwrite: bool = False,
    as_json: AsJson = False,
) -> None:
    """Query the archive in SQL, over the tables pulses and recordings.

    Parameters
    ----------
    directory
        Directory that uavrt batch wrote.
    sql
        An SQL query, in DuckDB's dialect.
    output
        Write the result to a .parquet or .csv file instead of the terminal.
    overwrite
        Replace that file if it exists.
    as_json
        Print one JSON object per line.
    """
    if output is not None:
        if output.suffix not in (".parquet", ".csv"):
            raise ConfigError(
                f"{output} is neither .parquet nor .csv",
                remedy="Choose a name that ends in .parquet or .csv",
            )
        check_place(output, overwrite=overwrite)
    from uavrt.analysis.archive.parquet.questions import ask

    answer = ask(directory, sql)
    if output is None:
        _print(answer, as_json)
    elif output.suffix == ".csv":
        from pyarrow import csv

        csv.write_csv(_flat(answer), output)
    else:
        from pyarrow import parquet

        parquet.write_table(answer, output)


@archive.command(help_epilogue=examples("archive export"))
def export(
    directory: Path,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    formats: Annotated[
        list[str] | None, Parameter(name="--format", consume_multiple=True, negative="")
    ] = None,
    flights: Annotated[
        list[str] | None, Parameter(name="--flight", consume_multiple=True, negative="")
    ] = None,
) -> None:
    """Write flights in the formats of uavrt export, and all of them as GeoParquet.

    Parameters
    ----------
    directory
        Directory that uavrt batch wrote.
    output
        Directory for the files: a folder for each flight, and the GeoParquet files.
    formats
        Any format of uavrt export but geotiff, or geoparquet; by default all.
    flights
        Flights to write; by default all that have pulses.
    """
    from uavrt.analysis.archive.exporting import export_archive

    for path in export_archive(directory, output, formats, flights):
        print(path)


def _flat(answer: "pa.Table") -> "pa.Table":
    """Write lists as JSON text; escape text that a spreadsheet would take for a formula."""
    import pyarrow as pa

    from uavrt.formats.csv_line import no_formula

    for number, field in enumerate(answer.schema):
        if pa.types.is_nested(field.type):
            texts = [
                None if one is None else json.dumps(one, default=str)
                for row in _rows(_in_microseconds(answer.select([number])))
                for one in row.values()
            ]
        elif pa.types.is_string(field.type):
            rows = _rows(answer.select([number]))
            texts = [no_formula(one) for row in rows for one in row.values()]
        else:
            continue
        answer = answer.set_column(number, field.name, pa.array(texts, pa.string()))
    return answer


def _in_microseconds(answer: "pa.Table") -> "pa.Table":
    """Round times down to microseconds, the resolution of Python's times."""
    import pyarrow as pa

    kinds = {field.name: field.type for field in answer.schema}
    for number, (name, kind) in enumerate(kinds.items()):
        if pa.types.is_timestamp(kind) and kind.unit == "ns":
            times = answer.column(number).cast(pa.timestamp("us", kind.tz), safe=False)
            answer = answer.set_column(number, name, times)
    return answer


def _rows(answer: "pa.Table") -> Iterator[dict[str, Any]]:
    """Read rows in blocks, so that Ctrl-C takes effect after each block."""
    for batch in answer.to_batches(max_chunksize=_ROWS):
        yield from batch.to_pylist()


def _print(answer: "pa.Table", as_json: bool) -> None:
    rows = _rows(_in_microseconds(answer))
    if as_json:
        for row in rows:
            print_json(row)
        return
    from rich.console import Console
    from rich.table import Table

    drawn = Table(box=None, pad_edge=False)
    for name in answer.column_names:
        drawn.add_column(name, overflow="fold")
    for row in rows:
        drawn.add_row(*(_cell(name, value) for name, value in row.items()))
    # In a file or a pipe each row is a line.
    Console(file=sys.stdout, width=None if sys.stdout.isatty() else WIDE).print(drawn)


def _cell(name: str, value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        if name.endswith(_PLACES):
            return f"{value:.6f}"
        if 0.0 < abs(value) < 0.1:
            return f"{value:.3g}"
        return f"{value:.1f}" if abs(value) < 1e4 else f"{value:.0f}"
    return str(value)[:23] if isinstance(value, datetime) else str(value)
