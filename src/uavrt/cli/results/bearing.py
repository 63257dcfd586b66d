"""``uavrt bearing``: estimate bearings of the tags of a flight or a pulse log."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from uavrt.cli.options.inputs import require_content
from uavrt.cli.options.kinds import Degrees
from uavrt.cli.shown.notices import warn
from uavrt.cli.shown.outputs import print_json

if TYPE_CHECKING:
    from uavrt.localization.estimates.flight_estimates import TagBearing


def bearing(
    pulses: Path,
    *,
    method: str = "pattern_ml",
    antenna: str | None = None,
    antenna_offset: Degrees = 0.0,
    recording: Path | None = None,
    learn: Path | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Estimate the bearing of each tag in each turn in place.

    Parameters
    ----------
    pulses
        A flight directory, a pulse log of 'uavrt detect' (CSV or JSON lines), or a
        pulse_pose_log.txt.
    method
        One of {bearing_methods}. pattern_ml gives a posterior with its interval; the others
        are for comparison.
    antenna
        Name of the antenna's pattern: {antennas}, or a CSV file of angles and gains. By default
        what the drone was set up with (bearings.antenna), and RA-23K for a log that does not
        state it.
    antenna_offset
        Boresight clockwise from the heading that the pulses contain [°]; 0 if the drone's own
        settings already include the mounting.
    recording
        The SigMF recording in which the pulses were found, made through an antenna switch:
        bearings come from the phases between its antennas (pseudo_doppler, two_point_phased).
    learn
        Correct the pattern using the turns of this flight, write it to this CSV file, and use
        it.
    as_json
        Print a list of objects.
    """
    require_content([pulses])
    from uavrt.analysis.estimates.bearings import bearings_together, read_recorded
    from uavrt.analysis.estimates.records import bearing_record
    from uavrt.analysis.measure.antenna_files import antenna_named, write_antenna
    from uavrt.analysis.measure.switched import switched_bearings
    from uavrt.localization.estimates.flight_estimates import EstimationOptions

    recorded = read_recorded(pulses)
    for warning in recorded.log.warnings:
        warn(warning)
    antenna = None if antenna is None else antenna_named(antenna)
    if learn is not None:
        from uavrt.analysis.estimates.bearings import learnt_antenna

        antenna = antenna or recorded.turning()
        pattern = learnt_antenna(recorded, antenna, antenna_offset)
        write_antenna(pattern, learn, f"{antenna}, corrected by {pulses.resolve().name}")
        antenna = antenna_named(str(learn))
    if recording is not None:
        found = switched_bearings(
            recording, recorded.log.pulse_poses, offset_deg=antenna_offset
        )
    else:
        how = EstimationOptions(
            bearing_method=method, antenna=antenna, offset_deg=antenna_offset
        )
        found = bearings_together([recorded], how, warn)
    if as_json:
        print_json([bearing_record(one) for one in found], indent=2)
        return
    for one in found:
        print(_sentence(one))
    if not found:
        print(f"{pulses}: no pulses during a turn in place")


def _sentence(one: "TagBearing") -> str:
    found = one.bearing
    text = f"tag {one.tag_id}: {found.bearing_deg:.1f}°"
    if found.interval90_deg is not None:
        low, high = found.interval90_deg
        text += f", 90 % within {low:.1f}° to {high:.1f}°"
    text += f", {found.pulses} pulses at {one.latitude_deg:.6f}, {one.longitude_deg:.6f}"
    return "; ".join([text, *found.remarks])
