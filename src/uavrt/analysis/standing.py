"""What flights and logs tell of tags that they heard in no turn in place."""

import math
from collections.abc import Sequence

import numpy as np

from uavrt.analysis.bearings import TagBearing
from uavrt.localization import (
    LEAST_TURN_DEG,
    AntennaPattern,
    PoseColumns,
    PulseColumns,
    Rhythm,
    Strengths,
    strengths_of,
    yaws_deg,
)
from uavrt.localization.position import LEAST_EXTENT_M
from uavrt.messages import PulsePose
from uavrt.recording import Flight
from uavrt.tangent_plane import plane_around


def stands(pulse_poses: Sequence[PulsePose]) -> bool:
    """Whether pulses were heard at one place, which makes no survey by strength."""
    poses = [one.pose for one in pulse_poses if one.pose is not None]
    if not poses:
        return False
    latitude = np.array([one.latitude_deg for one in poses])
    longitude = np.array([one.longitude_deg for one in poses])
    away_m = np.hypot(*plane_around(latitude, longitude).to_local(latitude, longitude))
    return float(np.quantile(away_m, 0.95)) < LEAST_EXTENT_M


def strengths_without_bearing(
    name: str,
    pulse_poses: Sequence[PulsePose],
    bearings: Sequence[TagBearing],
    antenna: AntennaPattern | str,
    offset_deg: float = 0.0,
    flight: Flight | None = None,
) -> dict[int, Strengths]:
    """Strengths of each tag of which a flight or log gives no bearing.

    Parameters
    ----------
    name : str
        Of the flight or log, for the operator.
    pulse_poses : sequence of PulsePose
        All that it heard.
    bearings : sequence of TagBearing
        Its own.
    antenna : AntennaPattern or str
        Its pattern, or a monopole.
    offset_deg : float
        Boresight clockwise from the heading that the pulses carry.
    flight : Flight, optional
        None of a log: intervals, and what was not flown, are then not known.
    """
    usable = [one for one in pulse_poses if one.pose and math.isfinite(one.pulse.snr_db)]
    usable.sort(key=lambda one: one.pulse.start_time_ns)
    own = {
        tag_id: PulseColumns.of([one for one in usable if one.pulse.tag_id == tag_id]).turned(
            offset_deg
        )
        for tag_id in {one.pulse.tag_id for one in usable}
    }
    turned = {
        one.tag_id
        for one in bearings
        if one.bearing.accepted or (one.tag_id in own and _turns(own[one.tag_id]))
    }
    poses = PoseColumns.of(
        [*(flight.poses if flight else ()), *(one.pose for one in usable if one.pose)],
        flight.on_ground_ns if flight else (),
    )
    tags = flight.info.tags if flight else ()
    rhythms = {tag.tag_id: Rhythm.of(tag) for tag in tags}
    return {
        tag_id: strengths_of(name, own[tag_id], poses, antenna, rhythms.get(tag_id))
        for tag_id in sorted(own.keys() - turned)
    }


def _turns(pulses: PulseColumns) -> bool:
    """Whether a bearing without a clear direction comes of a turn, not of one heading."""
    yaw = np.unwrap(yaws_deg(pulses.quaternion_wxyz), period=360.0)
    return float(np.ptp(yaw)) >= LEAST_TURN_DEG
