"""``uavrt attach``: poses of another program's log for pulses."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavrt.cli.outputs import check_place, keep_inputs
from uavrt.errors import ConfigError

MOST_OFFSET_S = 1e9
"""Thirty years: clocks that were never set begin in 1970, 1980 or 2000."""


def attach(
    pulses: Path,
    track: Path,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    clock_offset: float | None = None,
    yaw_offset: float = 0.0,
    antenna: str = "RA-23K",
) -> None:
    """Give pulses the poses of an autopilot's log or a receiver's track.

    Parameters
    ----------
    pulses
        A pulse log in any format that is known, or a flight directory.
    track
        PX4's .ulg, ArduPilot's .BIN or .tlog, NMEA sentences or GPX.
    output
        Pulses with poses: CSV when the name ends so, else JSON lines.
    clock_offset
        Seconds by which the pulses' clock is ahead of the track's; estimated when not given.
    yaw_offset
        Antenna's boresight clockwise from the vehicle's nose, degrees.
    antenna
        Name of the antenna's pattern, for estimating the offset from powers.
    """
    if clock_offset is not None and not abs(clock_offset) < MOST_OFFSET_S:
        raise ConfigError(
            f"a clock offset of {clock_offset:g} s", remedy="Give --clock-offset in seconds"
        )
    if not abs(yaw_offset) <= 360.0:
        raise ConfigError(
            f"a yaw offset of {yaw_offset:g}°", remedy="Give --yaw-offset from -360 to 360"
        )
    check_place(output, overwrite=True)
    keep_inputs(output, (pulses, track))
    from uavrt.analysis.antenna_files import antenna_named
    from uavrt.analysis.tracks import ClockOffset, attach_poses, estimate_offset, read_track
    from uavrt.config.settings import AntennaSettings
    from uavrt.recording import PulseWriter, pulse_format
    from uavrt.recording.formats import read_pulse_log

    log, way = read_pulse_log(pulses), read_track(track)
    for warning in way.warnings:
        print(f"uavrt: {warning}", file=sys.stderr)
    if clock_offset is None:
        found = estimate_offset(log.pulse_poses, way, antenna=antenna_named(antenna))
    else:
        found = ClockOffset(offset_s=clock_offset, found_by="given")
    settings = AntennaSettings(yaw_offset_deg=yaw_offset)
    attached = attach_poses(log.pulse_poses, way, found.offset_s, settings)
    with output.open("w", newline="", encoding="utf-8") as stream:
        writer = PulseWriter(stream, pulse_format(output.name))
        for one in attached:
            writer.write(one)
    placed = sum(one.pose is not None for one in attached)
    text = f"{placed} of {len(attached)} pulses have a pose now"
    offset = f"clock offset {found.offset_s:+.2f} s"
    if found.sigma_s is not None:
        offset += f" ± {found.sigma_s:.2f} s, {found.heading_sigma_deg:.1f}° in a turn"
    print(f"{text}; {offset} ({found.found_by})", file=sys.stderr)
