"""``uavrt season``: summarise a folder of flights."""

from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from rich.console import Console

from uavrt.cli.shown.notices import warn
from uavrt.cli.shown.outputs import check_place, print_json
from uavrt.core.clock import iso_utc
from uavrt.core.terminal_tables import table_of
from uavrt.core.units import counted
from uavrt.formats.csv_line import TableWriter

if TYPE_CHECKING:
    from uavrt.analysis.season import Season


def season(
    directory: Path,
    *,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Summarize a folder of flights: flights, minutes for each animal, batteries.

    A flight that was both received live and fetched from the drone counts once.

    Parameters
    ----------
    directory
        The folder; flights may lie at any depth.
    output
        Also write a line for each animal to this CSV file.
    overwrite
        Replace that file if it exists.
    as_json
        Print one JSON object.
    """
    from uavrt.analysis.season import read_season

    if output is not None:
        check_place(output, overwrite=overwrite)
    found = read_season(directory)
    for name in found.unreadable:
        warn(f"{name} cannot be read and is left out")
    if output is not None:
        _write(found, output)
    if as_json:
        print_json(found, indent=2)
    else:
        _show(found)


def _write(found: "Season", path: Path) -> None:
    from uavrt.analysis.season import AnimalOfSeason

    with path.open("w", newline="", encoding="utf-8") as file:
        writer = TableWriter(file)
        writer.writerow(field.name for field in fields(AnimalOfSeason))
        writer.writerows(asdict(animal).values() for animal in found.animals)


def _show(found: "Season") -> None:
    console = Console()
    per_animal = found.minutes_per_animal
    lines = [
        f"{counted(found.flights, 'flight')}, {found.minutes:.0f} minutes, "
        f"{_day(found.first_ns)} to {_day(found.last_ns)}",
        f"{found.animals_heard} of {len(found.animals)} animals detected"
        + ("" if per_animal is None else f", {per_animal:.1f} minutes of flight per detection"),
        f"{counted(found.batteries, 'battery', 'batteries')} used, "
        f"{found.batteries_used:.1f} full charges in total"
        if found.batteries
        else "no flight has battery data",
    ]
    if found.batteries and found.flights_without_battery:
        count = found.flights_without_battery
        text = "flights have no battery data"
        lines.append("1 flight without battery data" if count == 1 else f"{count} {text}")
    if found.copies:
        copies = "copy of a flight" if found.copies == 1 else "copies of flights"
        lines.append(f"{found.copies} second {copies} left out")
    for line in lines:
        console.print(line, highlight=False, soft_wrap=True)
    titles = ("tag", "name", "MHz", "flights", "detected", "min", "min each", "last")
    table = table_of(*titles, left=("name",), box=None, pad_edge=False)
    for one in found.animals:
        table.add_row(
            str(one.tag_id),
            one.name or "",
            f"{one.frequency_hz / 1e6:.3f}",
            str(one.flights),
            str(one.flights_heard),
            f"{one.minutes:.0f}",
            "" if one.minutes_to_hear is None else f"{one.minutes_to_hear:.1f}",
            _day(one.last_heard_ns),
        )
    console.print(table)


def _day(time_ns: int | None) -> str:
    return "" if time_ns is None else iso_utc(time_ns)[:10]
