"""``uavrt report``: write the results of a flight to read, print and share."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from uavrt.cli.options.inputs import require_content
from uavrt.cli.options.kinds import Power
from uavrt.cli.options.placing_options import USUAL_PLACING, Placing
from uavrt.cli.shown.notices import warn
from uavrt.cli.shown.progress_bars import progress_bars
from uavrt.core.errors import FormatError, UsageError

if TYPE_CHECKING:
    from uavrt.analysis.covered.silence import SilentMap
    from uavrt.analysis.inputs.map_files import MapFile
    from uavrt.analysis.survey import Survey
    from uavrt.localization.terrain.elevation import Elevation


def report(
    flight: Path,
    *,
    place: Placing = USUAL_PLACING,
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
    tag_power
        Radiated power of tags [dBm]: with it the report maps where each listed tag would be
        detected. Takes seconds to a minute for each.
    background
        A map file (MBTiles or PMTiles of pictures) to lie under the flight; by default the
        finest that covers it in the folder maps next to the flight, where the ground station
        keeps the page's maps. Nothing is downloaded.
    html
        Write report.html.
    pdf
        Write report.pdf.
    output
        Directory to write into; by default the flight directory, or the log's folder.
    """
    if output is not None and output.suffix in (".pdf", ".html") and not output.is_dir():
        raise UsageError(
            f"{output} looks like a file name, but a report is written into a directory",
            remedy=f"Give the directory: -o {output.parent}",
        )
    if not html and not pdf:
        raise UsageError(
            "--no-html and --no-pdf together leave nothing to write",
            remedy="Leave one of them out",
        )
    require_content([flight])
    from uavrt.analysis.inputs.map_files import maps_in
    from uavrt.analysis.report.document import pdf_document
    from uavrt.analysis.report.report_page import html_page
    from uavrt.analysis.survey import read_survey
    from uavrt.formats.whole_file import write_whole

    how = place.estimation_options()
    survey = read_survey(flight, how)
    map_folder = flight.absolute().parent / "maps"
    maps = maps_in(map_folder) if background is None else (_named_map(background),)
    survey = replace(survey, maps=maps)
    if tag_power is not None:
        named = None if how.antenna is None else survey.antenna
        survey = replace(
            survey, silences=_silences(flight, survey, tag_power, how.elevation, named)
        )
    for warning in survey.warnings:
        warn(warning)
    name = "report" if flight.is_dir() else f"{flight.stem}_report"
    folder = output or (flight if flight.is_dir() else flight.parent)
    paths = folder / f"{name}.html", folder / f"{name}.pdf"
    if html:
        write_whole(paths[0], html_page(survey))
    if pdf:
        write_whole(paths[1], pdf_document(survey))
    for path, wanted in zip(paths, (html, pdf), strict=True):
        if wanted:
            print(path)


def _silences(
    flight: Path,
    survey: "Survey",
    tag_power_dbm: float,
    elevation: "Elevation | None",
    antenna: str | None,
) -> "tuple[SilentMap, ...]":
    """Map where each listed tag would have been detected, with a progress bar."""
    from uavrt.analysis.covered.silence import silent_map
    from uavrt.flight.flight_layout import FlightLayout
    from uavrt.flight.reading.flight_reader import read_flight

    if survey.info is None or not FlightLayout(flight).database.is_file():
        raise UsageError(
            "a pulse log does not show where the drone detected nothing",
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
                on_pulse=add_bar(f"where tag {tag.tag_id} would be detected"),
            )
            for tag in survey.info.tags
        )


def _named_map(path: Path) -> "MapFile":
    from uavrt.analysis.inputs.map_files import RASTERS, read_map

    found = read_map(path)
    if found.tiles not in RASTERS:
        raise FormatError(
            f"{path} is a vector map; a report needs a raster map",
            remedy="Make a raster map with QGIS: Generate XYZ tiles (MBTiles)",
        )
    return found
