"""``uavrt export``: a flight as files for other tools."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavrt.errors import ConfigError


def export(
    flight: Path,
    *,
    formats: Annotated[
        list[str] | None, Parameter(name="--format", consume_multiple=True, negative="")
    ] = None,
    mcap: Annotated[bool, Parameter(negative="")] = False,
    as_sent: Annotated[bool, Parameter(negative="")] = False,
    antenna: str | None = None,
    height: float | None = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> None:
    """Write a flight, or an old pulse log, as files for other tools.

    Parameters
    ----------
    flight
        A flight directory, or a pulse log in any format that is known.
    formats
        Any of csv, uavrt (the original's bearings.csv, positions.csv and pulse CSV), geojson,
        kmz, gpx, geopackage, movebank, geotiff (heat maps); by default all of them.
    mcap
        As a ROS 2 recording for `ros2 bag play` and Foxglove: pulses, poses, commands and log
        with the messages of the live topics; tags, start and stop under /recorded, so that
        playing them commands no drone. Needs the extra uavrt[analysis]. Alone unless --format
        is given too.
    as_sent
        With --mcap: orders under the names of the live topics. Play such a recording only where
        no drone listens.
    antenna
        Name of the antenna's pattern, for the bearings; monopole: positions and a map of the
        strongest signal from strength along the flight. Without it RA-23K; for UCSD's pings,
        monopole.
    height
        With a monopole: height over the tags [m], for logs that do not tell it (UCSD's pings).
    output
        Directory to make; by default "export" in the flight directory or beside the log, and
        "bag" in the flight directory for --mcap.
    """
    if mcap:
        from uavrt.analysis.bag import export_bag

        target = flight / "bag" if output is None else output
        inside = target / "bag" if formats and output else target
        bag = export_bag(flight, inside, as_sent=as_sent)
        for topic, count in sorted(bag.messages.items()):
            print(f"{count:8d}  /{topic}")
        print(bag.file)
        if not formats:
            return
    from uavrt.analysis.antenna_files import antenna_named
    from uavrt.analysis.export import EXPORT_FORMATS, export_survey
    from uavrt.analysis.survey import read_survey

    chosen = [form for form in EXPORT_FORMATS if not formats or form in formats]
    if unknown := sorted(set(formats or ()) - set(EXPORT_FORMATS)):
        raise ConfigError(
            f"there is no format {', '.join(unknown)}",
            remedy=f"Known are {', '.join(EXPORT_FORMATS)}",
        )
    survey = read_survey(
        flight,
        antenna=None if antenna is None else antenna_named(antenna),
        height_m=height,
    )
    for warning in survey.warnings:
        print(f"uavrt: {warning}", file=sys.stderr)
    beside = flight if flight.is_dir() else flight.parent
    for path in export_survey(survey, output or beside / "export", chosen):
        print(path)
