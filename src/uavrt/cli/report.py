"""``uavrt report``: what a flight found, to read, print and pass on."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from uavrt.cli.elevation import elevation_of
from uavrt.cli.inputs import require_content
from uavrt.cli.kinds import Degrees, DegreesOfError, Metres, MetresOfError, Power
from uavrt.cli.progress import progress_bars
from uavrt.errors import FormatError, UsageError

if TYPE_CHECKING:
    from uavrt.analysis.map_files import MapFile
    from uavrt.analysis.silence import SilentMap
    from uavrt.analysis.survey import Survey
    from uavrt.terrain.elevation import Elevation


def report(
    flight: Path,
    *,
    antenna: str | None = None,
    antenna_offset: Degrees = 0.0,
    height: Metres | None = None,
    heading_error: DegreesOfError = 1.5,
    height_error: MetresOfError = 7.0,
    dem: Path | None = None,
    sea: Annotated[bool, Parameter(negative="")] = False,
    tag_power: Power | None = None,
    background: Annotated[Path | None, Parameter(name="--map")] = None,
    html: bool = True,
    pdf: bool = True,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> None:
    """Write a report on a flight or an old pulse log, as HTML and PDF, readable offline.

    Parameters
    ----------
    flight
        A flight directory, or a pulse log in any known format.
    antenna
        Name of the antenna's pattern: RA-23K, RA-2A, H3, H, yagi-2, one from another package,
        or a CSV file of angles and gains;
        monopole: no bearings, positions from signal strength along the flight. Default: RA-23K;
        for UCSD's pings, monopole.
    antenna_offset
        Boresight clockwise from the heading that the pulses contain [°]; 0 if the drone's own
        settings already include the mounting.
    height
        With a monopole: height above the tags [m], for logs that do not contain it (UCSD's
        pings).
    heading_error
        Standard deviation of the heading error common to a whole flight [°]: compass, mounting,
        declination. 0 trusts the headings.
    height_error
        With a monopole: standard deviation of the error common to all heights above a tag [m]:
        terrain, a tag on a tree, a take-off on a hill. 0 trusts the heights.
    dem
        Elevation file (SRTM .hgt or GeoTIFF) or a folder of them: hills weaken what is heard,
        and explain silence. Without it the ground is taken as level.
    sea
        Take ground that no elevation file covers for water at height 0.
    tag_power
        What the tags radiate [dBm]: with it the report maps where each listed tag would have
        been heard. Takes seconds to a minute for each.
    background
        A map file (MBTiles or PMTiles of pictures) to lie under the flight; by default the
        finest that covers it in the folder maps beside the flight, where the ground station
        keeps what the page has brought. Nothing is fetched.
    html
        Write report.html.
    pdf
        Write report.pdf.
    output
        Directory to write into; by default the flight directory, or beside the log.
    """
    if output is not None and output.suffix in (".pdf", ".html") and not output.is_dir():
        raise UsageError(
            f"{output} is named as a file; a report is written into a directory",
            remedy=f"Give the directory: -o {output.parent}",
        )
    if not html and not pdf:
        raise UsageError("there is nothing to write", remedy="Leave out --no-html or --no-pdf")
    require_content([flight])
    from uavrt.analysis.map_files import maps_in
    from uavrt.analysis.measure.antenna_files import antenna_named
    from uavrt.analysis.report.written import write_report
    from uavrt.analysis.survey import read_survey
    from uavrt.localization.flight_estimates import ReadAs

    elevation = elevation_of(dem, sea=sea)
    how = ReadAs(
        antenna=None if antenna is None else antenna_named(antenna),
        height_m=height,
        offset_deg=antenna_offset,
        heading_sigma_deg=heading_error,
        height_sigma_m=height_error,
        elevation=elevation,
    )
    survey = read_survey(flight, how)
    beside = flight.absolute().parent / "maps"
    maps = maps_in(beside) if background is None else (_named_map(background),)
    survey = replace(survey, maps=maps)
    if tag_power is not None:
        named = None if antenna is None else survey.antenna
        survey = replace(
            survey, silences=_silences(flight, survey, tag_power, elevation, named)
        )
    for warning in survey.warnings:
        print(f"uavrt: {warning}", file=sys.stderr)
    name = "report" if flight.is_dir() else f"{flight.stem}_report"
    place = output or (flight if flight.is_dir() else flight.parent)
    written = write_report(
        survey,
        place / f"{name}.html" if html else None,
        place / f"{name}.pdf" if pdf else None,
    )
    for path in written:
        print(path)


def _silences(
    flight: Path,
    survey: "Survey",
    tag_power_dbm: float,
    elevation: "Elevation | None",
    antenna: str | None,
) -> "tuple[SilentMap, ...]":
    """Map where each listed tag would have been heard; shows how far it is."""
    from uavrt.analysis.silence import silent_map
    from uavrt.recording.flight_reader import read_flight
    from uavrt.recording.layout import FlightLayout

    if survey.info is None or not FlightLayout(flight).database.is_file():
        raise UsageError(
            "a pulse log does not tell where the drone listened in vain",
            remedy="Name the flight's directory, or leave --tag-power out",
        )
    flown = read_flight(flight)
    with progress_bars() as add_bar:
        return tuple(
            silent_map(
                flight,
                flown,
                tag.tag_id,
                tag_power_dbm,
                elevation=elevation,
                antenna=antenna,
                on_pulse=add_bar(f"where tag {tag.tag_id} would have been heard"),
            )
            for tag in survey.info.tags
        )


def _named_map(path: Path) -> "MapFile":
    from uavrt.analysis.map_files import RASTERS, read_map

    found = read_map(path)
    if found.tiles not in RASTERS:
        raise FormatError(
            f"{path} holds lines and areas, no pictures",
            remedy="Give a map of pictures: QGIS, Generate XYZ tiles (MBTiles)",
        )
    return found
