"""Experiment L8: surveys narrower than three flight heights, tags in and beside the lines."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.results import Position
from uavrt.localization.tuning import FLIGHT
from uavrt_experiments.figures import measured, median, share
from uavrt_experiments.result import Row

PLANE = TangentPlane(latitude_deg=47.0, longitude_deg=8.0)
HALF_M, LOW_M, HIGH_M = 40.0, -30.0, 42.0
"""Half of the survey's width, and its southern and northern limits [m]."""
_HEIGHT_M, _PULSES, _STEP_M = 30.0, 340, 1.6


@dataclass(frozen=True, slots=True, kw_only=True)
class SmallSurvey:
    """A tag and the strengths along a flight over 80 by 72 m, 30 m high."""

    track: PowerTrack
    tag_m: tuple[float, float]

    def miss_m(self, found: Position) -> float:
        """Distance of a position from the tag [m]."""
        east, north = PLANE.to_local(found.latitude_deg, found.longitude_deg)
        return float(np.hypot(east - self.tag_m[0], north - self.tag_m[1]))


def small_survey(
    rng: Generator,
    *,
    spacing_m: float,
    south_m: tuple[float, float],
    lasting_db: float = 1.6,
    fast_db: float = 0.0,
    place_sigma_m: float = FLIGHT.place_sigma_m,
) -> SmallSurvey:
    """Draw a tag within limits of its north coordinate, and fly lines over the area.

    `lasting_db`, `fast_db`: fading with a correlation of 0.6 between neighbouring pulses, and
        fading of each pulse alone. `place_sigma_m`: error that all positions share.
    """
    line, along = np.divmod(np.arange(_PULSES) * _STEP_M, 2.0 * HALF_M)
    east = np.where(line % 2 == 0, along - HALF_M, HALF_M - along)
    north = (line * spacing_m) % (HIGH_M - LOW_M) + LOW_M
    tag = float(rng.uniform(-35.0, 35.0)), float(rng.uniform(*south_m))
    ground = np.hypot(east - tag[0], north - tag[1])
    slant = np.hypot(ground, _HEIGHT_M)
    snr_db = 40.0 - 25.0 * np.log10(slant / 30.0)
    snr_db += 20.0 * np.log10(np.maximum(ground / slant, 0.03))
    snr_db += lasting_db * lfilter([0.8], [1.0, -0.6], rng.normal(size=_PULSES))
    snr_db += fast_db * rng.normal(size=_PULSES)
    shift = rng.normal(0.0, place_sigma_m, 2) if place_sigma_m else np.zeros(2)
    latitude, longitude = PLANE.to_geodetic(east + shift[0], north + shift[1])
    track = PowerTrack(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.full(_PULSES, _HEIGHT_M),
        snr_db=snr_db,
    )
    return SmallSurvey(track=track, tag_m=tag)


def small_surveys(
    runs: int,
    seed: int,
    spacings_m: tuple[float, ...] = (12.0, 24.0),
    outsides_m: tuple[float | None, ...] = (None, 5.0, 10.0, 15.0, 20.0),
) -> list[Row]:
    """L8: coverage of the circles, for tags inside or some metres beyond the outermost line."""
    rows = []
    for spacing_m in spacings_m:
        for outside_m in outsides_m:
            south_m, name = (-30.0, 35.0), f"lines {spacing_m:g} m apart, tag inside"
            if outside_m is not None:
                south_m = (LOW_M - outside_m, LOW_M - outside_m)
                name = f"lines {spacing_m:g} m apart, tag {outside_m:g} m outside"
            errors, half, most = [], [], []
            for number in range(runs):
                rng = np.random.default_rng([seed, number])
                flown = small_survey(rng, spacing_m=spacing_m, south_m=south_m)
                found = estimate_position(powers=flown.track)
                assert found.radius50_m is not None
                assert found.radius95_m is not None
                errors.append(flown.miss_m(found))
                half.append(float(errors[-1] <= found.radius50_m))
                most.append(float(errors[-1] <= found.radius95_m))
            rows += [
                measured("L8", name, "median [m]", errors, median),
                measured("L8", name, "50 % circle holds", half, share),
                measured("L8", name, "95 % circle holds", most, share, least=0.92),
            ]
    return rows
