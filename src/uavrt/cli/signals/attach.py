"""``uavrt attach``: add poses from another program's log to pulses."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavrt.cli.options.inputs import require_content
from uavrt.cli.options.kinds import Degrees, SecondsApart, Vehicle
from uavrt.cli.options.near_codes import warn_of_near_codes
from uavrt.cli.shown.notices import notice, warn
from uavrt.cli.shown.outputs import check_place, keep_inputs


def attach(
    pulses: Path,
    track: Path,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    clock_offset: SecondsApart | None = None,
    yaw_offset: Degrees = 0.0,
    antenna: str = "RA-23K",
    tags: Path | None = None,
    vehicle: Vehicle | None = None,
) -> None:
    """Add poses from an autopilot's log or a GPS track to pulses.

    Parameters
    ----------
    pulses
        A pulse log in any known format, or a flight directory.
    track
        PX4's .ulg, ArduPilot's .BIN or .tlog, NMEA sentences, GPX, or a telemetry.csv as `uavrt
        simulate` writes it.
    output
        File for pulses with poses: CSV if the name ends in .csv, else JSON lines.
    clock_offset
        Seconds by which the pulses' clock is ahead of the track's; estimated by default.
    yaw_offset
        Antenna's boresight clockwise from the vehicle's nose, degrees.
    antenna
        Name of the antenna's pattern, for estimating the offset from signal strength.
    tags
        Tag list with codes: pulses of a log without codes, such as a SensorGnome's, are
        grouped into bursts of these codes; all other pulses are left out.
    vehicle
        MAVLink system id of the drone with the receiver, if a .tlog contains several drones.
    """
    check_place(output, overwrite=True)
    keep_inputs(output, (pulses, track, *([] if tags is None else [tags])))
    require_content([pulses])
    from uavrt.analysis.inputs.found_bursts import bursts_of_pulses
    from uavrt.analysis.measure.antenna_files import antenna_named
    from uavrt.analysis.tracks.attach import (
        ClockOffset,
        attach_poses,
        estimate_offset,
        require_poses,
    )
    from uavrt.analysis.tracks.recognised import read_track
    from uavrt.config.settings import AntennaSettings
    from uavrt.config.tags.tag_files import read_tags
    from uavrt.flight.logs.pulse_files import PulseWriter, pulse_format
    from uavrt.flight.reading.recognise import read_pulse_log

    log, way = read_pulse_log(pulses), read_track(track, vehicle)
    heard = log.pulse_poses
    if tags is not None:
        listed = read_tags(tags)
        warn_of_near_codes(listed)
        heard = tuple(bursts_of_pulses(log.pulse_poses, listed))
        warn(f"{len(heard)} bursts of listed codes in {len(log.pulse_poses)} pulses")
    for warning in (*log.warnings, *way.warnings):
        warn(warning)
    if clock_offset is None:
        found = estimate_offset(heard, way, antenna=antenna_named(antenna))
    else:
        found = ClockOffset(offset_s=clock_offset, found_by="given")
    settings = AntennaSettings(yaw_offset_deg=yaw_offset)
    attached = attach_poses(heard, way, found.offset_s, settings)
    placed = require_poses(attached, found.offset_s)
    with output.open("w", newline="", encoding="utf-8") as stream:
        coded = any(one.pulse.burst_starts_ns for one in attached)
        writer = PulseWriter(stream, pulse_format(output.name), bursts=coded)
        for one in attached:
            writer.write(one)
    text = f"{placed} of {len(attached)} pulses have a pose now"
    if placed < len(attached):
        text += f"; the track has no pose for {len(attached) - placed}"
    offset = f"clock offset {found.offset_s:+.2f} s"
    if found.sigma_s is not None:
        offset += f" ± {found.sigma_s:.2f} s, {found.heading_sigma_deg:.1f}° in a turn"
    notice(f"{text}; {offset} ({found.found_by})")
