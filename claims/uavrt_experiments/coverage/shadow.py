"""Positions over hills, with an elevation map and without.

Surveys by strength with an upright monopole, over hills or on both sides of a ridge. The
simulated world's own code (`uavrt.simulation.scene.relief`) computes the loss of each pulse by
the ground; pulses below the threshold are missed. The map is like SRTM's: a height each 30 m,
with errors of some metres.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from uavrt.localization.antenna import monopole_gain_db
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.simulation.scene.relief import Relief
from uavrt_experiments.figures import measured, median, share
from uavrt_experiments.kept import KeptOutcomes
from uavrt_experiments.result import Row
from uavrt_experiments.search.terrain import PLANE, Hills, elevation_of

_Floats = NDArray[np.float64]
Heights = Callable[[_Floats, _Floats], _Floats]
"""Height of the ground [m] at metres east and north of the take-off."""
FREQUENCY_HZ = 150e6
_WAVELENGTH_M = 299_792_458.0 / FREQUENCY_HZ
_TAG_M = 0.5
_THRESHOLD_DB = 10.0
_STEP_M = 9.0
"""Distance between pulses [m]: 6 m/s and one pulse each 1.5 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OverHillsCase:
    """A survey over ground that is not level."""

    name: str
    ridge: bool = False
    """True: one ridge through the survey; False: hills on all sides."""
    relief_m: float = 100.0
    up_m: float = 60.0
    level_db: float = 40.0
    """SNR at 100 m on level ground [dB]."""
    fading_db: float = 3.0
    map_error_m: float = 3.0
    """Standard deviation of the map's height errors [m], which are constant over 60 m."""
    loss_factor: float = 1.0
    """Ratio of the true loss by the ground to that of the diffraction model."""


CASES = (
    OverHillsCase(name="a ridge", ridge=True),
    OverHillsCase(name="hills"),
    OverHillsCase(name="a ridge with 1.3 times the loss", ridge=True, loss_factor=1.3),
)


def ridge_land(rng: Generator) -> Heights:
    """A ridge from south to north, 30 to 50 m high, through the survey."""
    high, at = rng.uniform(30.0, 50.0), rng.uniform(-100.0, 100.0)

    def heights(east_m: _Floats, north_m: _Floats) -> _Floats:
        return np.asarray(400.0 + high * np.exp(-(((east_m - at) / 70.0) ** 2)) + 0.0 * north_m)

    return heights


def surveyed(
    rng: Generator, case: OverHillsCase, heights: Heights, tag: tuple[float, float]
) -> PowerTrack | None:
    """Fly lines and receive pulses; None if there are too few."""
    corners = []
    for number, north in enumerate(np.arange(-300.0, 301.0, 100.0)):
        ends = (-300.0, 300.0) if number % 2 == 0 else (300.0, -300.0)
        corners += [(ends[0], north), (ends[1], north)]
    path = np.array(corners)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    pulses = np.arange(0.0, along[-1], _STEP_M)
    east, north = (np.interp(pulses, along, path[:, axis]) for axis in (0, 1))
    relief = Relief(lambda n, e: heights(e, n))
    down = -(relief.height_m(tag[1], tag[0]) + _TAG_M)
    lost = np.array(
        [
            relief.loss_db((y, x, -case.up_m), (tag[1], tag[0], down), _WAVELENGTH_M)
            for x, y in zip(east.tolist(), north.tolist(), strict=True)
        ]
    )
    above = case.up_m + down
    slant = np.sqrt((east - tag[0]) ** 2 + (north - tag[1]) ** 2 + above**2)
    snr = case.level_db - 25.0 * np.log10(slant / 100.0) - case.loss_factor * lost
    snr += monopole_gain_db(np.degrees(np.arcsin(above / slant)))
    snr += rng.normal(0.0, case.fading_db, len(snr))
    heard = np.flatnonzero(snr >= _THRESHOLD_DB)
    if len(heard) < 10:
        return None
    latitude, longitude = PLANE.to_geodetic(east, north)
    track = PowerTrack(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.full(len(snr), case.up_m),
        snr_db=np.where(snr >= _THRESHOLD_DB, snr, np.nan),
        threshold_db=_THRESHOLD_DB,
        time_s=pulses / 6.0,
    )
    # Before the first pulse and after the last it is not known that one must have come.
    pulse = np.arange(len(snr))
    return track.chosen((pulse >= heard[0]) & (pulse <= heard[-1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class OneFlight:
    """Position error [m], radius of the 95 % circle [m], and if the circle contained
    the tag.
    """

    miss_m: float
    radius_m: float

    @property
    def held(self) -> bool:
        """True if the 95 % circle contained the tag."""
        return self.miss_m <= self.radius_m


def fly(rng: Generator, case: OverHillsCase) -> tuple[OneFlight, OneFlight]:
    """Locate one flight's tag without the map, and with it."""
    while True:
        heights: Heights = ridge_land(rng)
        if not case.ridge:
            heights = Hills(seed=int(rng.integers(1 << 30)), relief_m=case.relief_m)
        tag = (float(rng.uniform(-300.0, 300.0)), float(rng.uniform(-300.0, 300.0)))
        track = surveyed(rng, case, heights, tag)
        if track is not None:
            break
    error_m = gaussian_filter(rng.normal(0.0, 1.0, (201, 201)), 2.0)
    error_m *= case.map_error_m / float(error_m.std())

    def mapped(east_m: _Floats, north_m: _Floats) -> _Floats:
        assert east_m.shape == error_m.shape
        return heights(east_m, north_m) + error_m

    hills = HillLosses(
        elevation_of(mapped),
        latitude_deg=PLANE.latitude_deg,
        longitude_deg=PLANE.longitude_deg,
        frequency_hz=FREQUENCY_HZ,
        tag_m=_TAG_M,
    )
    found = []
    for ground in (None, hills):
        position = estimate_position(None, track, hills=ground, follow=True)
        east, north = PLANE.to_local(position.latitude_deg, position.longitude_deg)
        assert position.radius95_m is not None
        miss = float(np.hypot(float(east) - tag[0], float(north) - tag[1]))
        found.append(OneFlight(miss_m=miss, radius_m=position.radius95_m))
    return found[0], found[1]


def survey_hills(
    runs: int,
    *,
    kept: KeptOutcomes,
    seed: int = 1,
    on_flight: Callable[[int], None] = lambda done: None,
) -> None:
    """Fly each case repeatedly; stores errors and circles of both positions.

    `runs`: flights of each case.
    `seed`: seeds everything random, with the case's and the flight's number.
    `on_flight`: receives the number of flights done.
    """
    for number, case in enumerate(CASES):
        for index in range(runs):
            rng = np.random.default_rng((seed, number, index))
            kept.take(f"C2 {number} {index}", partial(_flown, rng, case))
            on_flight(number * runs + index + 1)


def _flown(rng: Generator, case: OverHillsCase) -> list[tuple[float, float]]:
    """Error and 95 % radius [m] of both positions of one flight."""
    return [(one.miss_m, one.radius_m) for one in fly(rng, case)]


def shadow_rows(kept: KeptOutcomes) -> list[Row]:
    """Rows with errors and circles, without the map and with it; none for cases not
    yet flown.
    """
    rows: list[Row] = []
    for number, case in enumerate(CASES):
        flights = kept.of(f"C2 {number} ")
        for which, name in enumerate(("without the map", "with the map")):
            own = [OneFlight(miss_m=one[which][0], radius_m=one[which][1]) for one in flights]
            if not own:
                continue
            what = f"{case.name}, {name}"
            rows += [
                measured("C2", what, "error [m]", [one.miss_m for one in own], median),
                measured(
                    "C2", what, "radius of 95 % [m]", [one.radius_m for one in own], median
                ),
                measured(
                    "C2",
                    what,
                    "share of tags in the circle of 95 %",
                    [one.held for one in own],
                    share,
                    least=0.9 if which and case.loss_factor == 1.0 else None,
                ),
            ]
    return rows
