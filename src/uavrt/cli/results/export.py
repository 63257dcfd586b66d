"""``uavrt export``: write a flight as files for other tools."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavrt.cli.options.placing_options import USUAL_PLACING, Placing
from uavrt.cli.shown.notices import warn
from uavrt.core.errors import ConfigError


def export(
    flight: Path,
    *,
    formats: Annotated[
        list[str] | None, Parameter(name="--format", consume_multiple=True, negative="")
    ] = None,
    mcap: Annotated[bool, Parameter(negative="")] = False,
    as_sent: Annotated[bool, Parameter(negative="")] = False,
    place: Placing = USUAL_PLACING,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> None:
    """Write a flight, or an old pulse log, as files for other tools.

    Parameters
    ----------
    flight
        A flight directory, or a pulse log in any known format.
    formats
        Any of {export_formats}; by default all of them. uavrt: the original's bearings.csv,
        positions.csv and pulse CSV; kml: without pictures; geotiff: heat maps; motus: bursts of
        coded tags and beeps, as SensorGnome and find_tags write them.
    mcap
        Write a ROS 2 recording for `ros2 bag play` and Foxglove: pulses, poses, commands and
        log with the messages of the live topics; tags, start and stop go under /recorded, so
        that playback commands no drone. Needs the extra uavrt[analysis]. Writes other formats
        only if --format is given too.
    as_sent
        With --mcap: keep the live topic names for commands. Play such a recording only where no
        drone listens.
    output
        Directory to create; by default "export" in the flight directory or the log's folder, or
        "bag" in the flight directory for --mcap.
    """
    if mcap:
        from uavrt.analysis.measure.bag import export_bag

        target = flight / "bag" if output is None else output
        inside = target / "bag" if formats and output else target
        bag = export_bag(flight, inside, as_sent=as_sent)
        for topic, count in sorted(bag.messages.items()):
            print(f"{count:8d}  /{topic}")
        print(bag.file)
        if not formats:
            return
    from uavrt.analysis.export.written import EXPORT_FORMATS, export_survey
    from uavrt.analysis.survey import read_survey

    chosen = [form for form in EXPORT_FORMATS if not formats or form in formats]
    if unknown := sorted(set(formats or ()) - set(EXPORT_FORMATS)):
        raise ConfigError(
            f"there is no format {', '.join(unknown)}",
            remedy=f"Choose from {', '.join(EXPORT_FORMATS)}",
        )
    how = place.estimation_options()
    survey = read_survey(flight, how)
    for warning in survey.warnings:
        warn(warning)
    folder = flight if flight.is_dir() else flight.parent
    for path in export_survey(survey, output or folder / "export", chosen):
        print(path)
