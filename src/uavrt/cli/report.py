"""``uavrt report``: what a flight found, to read, print and pass on."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def report(
    flight: Path,
    *,
    antenna: str | None = None,
    height: float | None = None,
    html: bool = True,
    pdf: bool = True,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> None:
    """Write a report of a flight or an old pulse log: HTML and PDF, readable without internet.

    Parameters
    ----------
    flight
        A flight directory, or a pulse log in any format that is known.
    antenna
        Name of the antenna's pattern: RA-23K, RA-2A, H3, H, yagi-2, or one of another package;
        or a CSV file of angles and gains;
        monopole: no bearings, positions from strength along the flight. Without it RA-23K; for
        UCSD's pings, monopole.
    height
        With a monopole: height over the tags [m], for logs that do not tell it (UCSD's pings).
    html
        Write report.html.
    pdf
        Write report.pdf.
    output
        Directory to write into; by default the flight directory, or beside the log.
    """
    from uavrt.analysis.antenna_files import antenna_named
    from uavrt.analysis.report import write_report
    from uavrt.analysis.survey import read_survey

    survey = read_survey(
        flight,
        antenna=None if antenna is None else antenna_named(antenna),
        height_m=height,
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
