"""Decide whether a tag moved: whether its bearings or powers contradict a fixed position."""

from dataclasses import replace
from typing import Literal

import numpy as np

from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.bayes_model import Model
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.position.moving import around, path_by_bearings, path_by_powers
from uavrt.localization.position.survey_walk import SurveyWalk, survey_walk
from uavrt.localization.position.tuning import TRACK, WALK
from uavrt.localization.results import Position, TrackPoint
from uavrt.localization.tuning import LEVELS

Follow = Literal["never", "contradicted", "always"]
"""When to compute a tag's path: never, if the data contradict a resting tag (contradicted), or
always."""
_CONTRADICTS = frozenset({"walk", "contradiction"})
_MOVES = "the tag moved; its path was estimated from the bearings"
"""Reason given for receivers whose levels are unused because the tag moved."""


def followed(position: Position, model: Model, follow: Follow) -> Position:
    """Add the path of a moving tag to an estimated position.

    If the data are consistent with a resting tag, the position is unchanged, and a path is
    added only with ``"always"``. A position from bearings is also unchanged, since it allows
    for walking. If powers contradict a resting tag, the end of the path becomes the
    position.
    """
    if model.stations is not None:
        return _by_bearings(position, model, follow)
    if model.powers is not None and model.track is not None:
        return _by_powers(position, model, model.powers.chosen(model.track.kept), follow)
    return position


def _by_bearings(position: Position, model: Model, follow: Follow) -> Position:
    stations, grid = model.stations, position.grid
    assert stations is not None
    named = {one.name for one in position.cautions}
    # Bearings from one side, or only three, may contradict each other without a walk.
    contradicted = bool(named & _CONTRADICTS) and "unchecked" not in named
    has_times = stations.time_s is not None and len(stations.time_s) >= TRACK.least_times
    if follow == "contradicted" and not (contradicted and has_times):
        return position
    assert grid is not None
    around = Area(
        west_m=float(grid.east_m[0]),
        east_m=float(grid.east_m[-1]),
        south_m=float(grid.north_m[0]),
        north_m=float(grid.north_m[-1]),
    )
    heading_sigma_deg = model.known.heading_sigma_deg
    way = path_by_bearings(stations, model.plane, around, heading_sigma_deg=heading_sigma_deg)
    left_out = tuple(one.because(_MOVES) for one in model.listeners)
    return replace(position, track=way, listeners=left_out)


def _by_powers(
    position: Position, model: Model, powers: PowerTrack, follow: Follow
) -> Position:
    walk = _walk(model, _on_level_ground(position, model, powers))
    walked = walk is not None and walk.walked
    if follow == "contradicted" and not walked:
        return position
    if walk is not None and walked and powers.time_s is not None:
        half_m = TRACK.end_m + TRACK.end_m_s * float(np.ptp(powers.time_s))
        first, last = (
            around([walk.at(float(one))], half_m)
            for one in (min(powers.time_s), max(powers.time_s))
        )
        fading_db = walk.fading_db
    else:
        # No walk recognised: the tag's path begins near the flown path or its place of rest.
        place = model.plane.to_local(position.latitude_deg, position.longitude_deg)
        here = (float(place[0]), float(place[1]))
        flown = model.plane.to_local(powers.latitude_deg, powers.longitude_deg)
        first = around([here, *zip(*flown, strict=True)], TRACK.end_m)
        last, fading_db = None, LEVELS.fading_db
    way = path_by_powers(
        powers, model.plane, first, last, fading_db=fading_db, hills=model.hills
    )
    if walk is None or not walked:
        return replace(position, track=way)
    cautions = tuple(one for one in position.cautions if one.name != "height")
    return replace(_ended(position, way), cautions=(walk.caution, *cautions))


def _on_level_ground(position: Position, model: Model, powers: PowerTrack) -> PowerTrack:
    if model.hills is None:
        return powers
    place = model.plane.to_local(position.latitude_deg, position.longitude_deg)
    east, north = (np.array([float(one)]) for one in place)
    track = model.plane.to_local(powers.latitude_deg, powers.longitude_deg)
    lost = model.hills.seen_from(*track, powers.height_m)(east, north)[0]
    rise = float(model.hills.rise_m(east, north)[0])
    return replace(powers, snr_db=powers.snr_db + lost, height_m=powers.height_m - rise)


def _walk(model: Model, powers: PowerTrack) -> SurveyWalk | None:
    east, north = model.plane.to_local(powers.latitude_deg, powers.longitude_deg)
    shift_m = 0.0 if model.track is None else model.track.height_shift_m
    extent = max(float(np.ptp(east)), float(np.ptp(north)))
    margin = WALK.survey_margin * extent
    around = Area(
        west_m=float(east.min()) - margin,
        east_m=float(east.max()) + margin,
        south_m=float(north.min()) - margin,
        north_m=float(north.max()) + margin,
    )
    raised = replace(powers, height_m=np.maximum(powers.height_m + shift_m, 3.0))
    return survey_walk(east, north, raised, around, model.known.propagation)


def _ended(position: Position, way: tuple[TrackPoint, ...]) -> Position:
    if not way:
        return position
    last = way[-1]
    return replace(
        position,
        latitude_deg=last.latitude_deg,
        longitude_deg=last.longitude_deg,
        radius50_m=last.radius50_m,
        radius95_m=last.radius95_m,
        method="track",
        ellipse95=None,
        grid=None,
        at_edge=False,
        track=way,
    )
