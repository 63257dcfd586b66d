"""Experiment M1: posteriors in worlds that violate their model.

No constant of an estimator may be chosen by these worlds.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.analysis.estimates.positions import read_positions
from uavrt.core.earth.geodesy import distance_m
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.units import NANOSECONDS_PER_SECOND, wrap_degrees_360
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import MONOPOLE, PATTERNS, AntennaPattern
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.estimates.flight_estimates import EstimationOptions, survey
from uavrt.localization.estimates.heard import Heard, PulseColumns
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.results import Bearing, Position
from uavrt.localization.tuning import FLIGHT
from uavrt_experiments.figures import measured, median, share
from uavrt_experiments.localization.position_bars import survey as flown_lines
from uavrt_experiments.localization.rotations import Trial, matched_power
from uavrt_experiments.localization.small_survey_bars import small_survey
from uavrt_experiments.result import Row

_Floats = NDArray[np.float64]
PLANE = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
_YAW_DEG: _Floats = np.arange(60.0) * 6.0
_START_NS = 1_700_000_000 * NANOSECONDS_PER_SECOND


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """Position of a tag, and its error."""

    miss_m: float
    found: Position

    def holds(self, share_percent: int) -> bool:
        """True if the circle of 50 or 95 % contains the tag."""
        radius_m = self.found.radius50_m if share_percent == 50 else self.found.radius95_m
        assert radius_m is not None
        return self.miss_m <= radius_m


def _turn(
    rng: Generator,
    *,
    snr_db: float = 20.0,
    fading_db: float = 2.0,
    error_db: Callable[[_Floats], _Floats] = np.zeros_like,
    echo_db: float | None = None,
    line_db: float | None = None,
    noise_known: bool = True,
) -> Trial:
    """Simulate a turn of 60 pulses of an RA-23K, whose headings have their stated error.

    `error_db`: true pattern minus the table's, by the angle off boresight [deg].
    `echo_db`: level of a second path, 35 to 150 degrees to one side.
    `line_db`: noise of a power line over the receiver's own, on boresight.
    """
    pattern: AntennaPattern = PATTERNS["RA-23K"]
    truth = float(rng.uniform(0.0, 360.0))
    yaw = np.asarray(_YAW_DEG + rng.uniform(0.0, 6.0), np.float64)
    off_deg = np.asarray(truth - yaw, np.float64)
    own_db: _Floats = np.asarray(pattern.gain_db(off_deg), np.float64)
    own_db += error_db(off_deg)
    amplitude = np.asarray(10.0 ** (own_db / 20.0), np.complex128)
    if echo_db is not None:
        aside = rng.uniform(35.0, 150.0) * rng.choice([-1.0, 1.0])
        phase = rng.uniform(0.0, 2.0 * np.pi)
        gain_db = echo_db + pattern.gain_db(truth + aside - yaw)
        amplitude += 10.0 ** (gain_db / 20.0) * np.exp(1j * phase)
    noise = np.ones(len(yaw))
    if line_db is not None:
        line = truth + rng.uniform(0.0, 360.0)
        noise += 10.0 ** ((line_db + pattern.gain_db(line - yaw)) / 10.0)
    level_db = snr_db + 20.0 * np.log10(np.abs(amplitude) + 1e-9)
    level_db += rng.normal(0.0, fading_db, len(yaw)) - 10.0 * np.log10(noise)
    # As the product takes a turn whose noise is unknown.
    unmeasured_deg = 0.0 if noise_known else FLIGHT.unknown_noise_sigma_deg
    found: Bearing = estimate_bearing(
        yaw + rng.normal(0.0, FLIGHT.own_heading_sigma_deg),
        None,
        matched_power=matched_power(rng, level_db),
        noise_psd=noise if noise_known else None,
        heading_sigma_deg=float(np.hypot(FLIGHT.own_heading_sigma_deg, unmeasured_deg)),
    )
    return Trial(error_deg=difference_deg(found.bearing_deg, truth), bearing=found)


def _harmonics(rng: Generator, rms_db: float) -> Callable[[_Floats], _Floats]:
    """Draw a smooth pattern error of three harmonics with the given root of mean squares."""
    draws = rng.normal(size=(2, 3, 1))
    order = np.arange(1.0, 4.0)[:, np.newaxis]

    def unscaled(off_deg: _Floats) -> _Floats:
        angle = np.radians(off_deg) * order
        return np.asarray((draws[0] * np.cos(angle) + draws[1] * np.sin(angle)).sum(axis=0))

    scale = rms_db / float(unscaled(np.arange(360.0)).std())
    return lambda off_deg: scale * unscaled(off_deg)


def _turn_of_another(rng: Generator, *, rms_db: float) -> Trial:
    return _turn(rng, snr_db=30.0, fading_db=0.5, error_db=_harmonics(rng, rms_db))


def _other_back(off_deg: _Floats) -> _Floats:
    return np.where(np.abs(difference_deg(off_deg, 0.0)) > 120.0, 7.0, 0.0)


def _bearings(name: str, runs: int, seed: int, fly: Callable[[Generator], Trial]) -> list[Row]:
    trials = [fly(np.random.default_rng([seed, number])) for number in range(runs)]
    flagged = [float(one.bearing.multipath_suspected) for one in trials]
    second = "second path" in name
    pattern = "pattern" in name and "back" not in name
    holds = [float(one.covered) for one in trials]
    least, most = (0.86, 0.94) if "line" in name and "unknown" not in name else (None, None)
    return [
        measured("M1", name, "90 % arc holds", holds, share, least=least, most=most),
        measured(
            "M1",
            name,
            "reflection flagged",
            flagged,
            share,
            least=0.9 if second else None,
            most=0.05 if pattern else None,
        ),
    ]


def _small(rng: Generator, **world: float) -> Circle:
    flown = small_survey(rng, spacing_m=24.0, south_m=(-30.0, 35.0), **world)
    found = estimate_position(powers=flown.track)
    return Circle(miss_m=flown.miss_m(found), found=found)


def _past_a_line(rng: Generator, *, line_db: float | None, noise_known: bool = True) -> Circle:
    """Fly a survey of 300 m past a power line, 12 m high; its noise falls with distance."""
    tag = (float(rng.uniform(0.0, 300.0)), float(rng.uniform(0.0, 300.0)))
    flown: PowerTrack = flown_lines(rng, 300.0, 50.0, 4.0, 0.7, tag)
    east, north = PLANE.to_local(flown.latitude_deg, flown.longitude_deg)
    noise = np.ones(len(east))
    if line_db is not None:
        square = (east - rng.uniform(50.0, 250.0)) ** 2 + 28.0**2
        noise += 10.0 ** (line_db / 10.0) * 28.0**2 / square
    shift = rng.normal(0.0, 2.0, 2)
    latitude, longitude = PLANE.to_geodetic(east + shift[0], north + shift[1])
    count = len(east)
    assert flown.time_s is not None
    pulses = PulseColumns(
        time_ns=_START_NS + (flown.time_s * NANOSECONDS_PER_SECOND).astype(np.int64),
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=flown.height_m,
        quaternion_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        snr_db=flown.snr_db + 20.0 - 10.0 * np.log10(noise),
        noise_psd=noise if noise_known else np.full(count, np.nan),
        frequency_hz=np.full(count, 150e6),
        rate=np.ones(count, np.int64),
        altitude_amsl_m=np.full(count, np.nan),
    )
    heard = Heard.of(np.ones(count, np.int64), pulses, antenna=MONOPOLE)
    found = survey(heard, EstimationOptions(antenna=MONOPOLE))[0][1].position
    assert found is not None
    x, y = PLANE.to_local(found.latitude_deg, found.longitude_deg)
    return Circle(miss_m=float(np.hypot(x - tag[0], y - tag[1])), found=found)


def _observer(
    rng: Generator, *, shifted: float = 0.25, known: float = 0.0, turned_deg: float = 0.0
) -> Circle:
    """Take four bearings by hand from 100 to 400 m, with a common displacement.

    `shifted`, `known`: standard deviation of the displacement as a share of the distance, true
        and as the estimator assumes. `turned_deg`: largest common error of the headings.
    """
    middle = rng.uniform(0.0, 2.0 * np.pi)
    angle = middle + np.radians([-45.0, -15.0, 15.0, 45.0])
    away_m = rng.uniform(100.0, 400.0)
    east, north = away_m * np.sin(angle), away_m * np.cos(angle)
    seems = rng.normal(0.0, shifted * away_m, 2)
    bearing = np.degrees(np.arctan2(seems[0] - east, seems[1] - north))
    bearing += rng.normal(0.0, 5.0, 4) + rng.uniform(-turned_deg, turned_deg)
    latitude, longitude = PLANE.to_geodetic(east, north)
    stations = Stations(
        latitude_deg=latitude, longitude_deg=longitude, bearing_deg=wrap_degrees_360(bearing)
    )
    found = estimate_position(stations, displacement=known)
    x, y = PLANE.to_local(found.latitude_deg, found.longitude_deg)
    return Circle(miss_m=float(np.hypot(x, y)), found=found)


def crew(
    rng: Generator,
    *,
    scatter_deg: float,
    share: float = 0.0,
    metres: float = 0.0,
    farthest_m: float = 400.0,
    trials: int = 20,
    tags: int = 20,
) -> list[Circle]:
    """Let a new person locate tags by hand after test trials, recorded as by field crews.

    `scatter_deg`, `share`, `metres`: true scatter of the bearings, and true displacement.
    `farthest_m`: largest distance of the four stations from a tag; the least is 100 m.
    `trials`: number of test trials; 0: the person is unknown. `tags`: number of tags located
        after the trials.
    """
    error_deg = rng.normal(0.0, 4.0)

    def table(first: int, count: int, heading: str) -> str:
        rows = [heading]
        for tag_id in range(first, first + count):
            tag = rng.uniform(-2000.0, 2000.0, 2)
            there = PLANE.to_geodetic(*tag)
            away_m, around = rng.uniform(100.0, farthest_m), rng.choice([90.0, 360.0])
            angle = np.radians(rng.uniform(0.0, 360.0) + np.arange(4) * around / 4.0)
            seems = tag + rng.normal(0.0, np.hypot(share * away_m, metres), 2)
            for east, north in zip(
                tag[0] + away_m * np.sin(angle), tag[1] + away_m * np.cos(angle), strict=True
            ):
                bearing = np.degrees(np.arctan2(seems[0] - east, seems[1] - north))
                bearing += error_deg + rng.normal(0.0, scatter_deg)
                here = PLANE.to_geodetic(east, north)
                cells = (tag_id, "Ada", *here, wrap_degrees_360(float(bearing)), *there)
                rows.append(",".join(map(str, cells)))
        return "\n".join(rows) + "\n"

    columns = "tag_id,observer,latitude_deg,longitude_deg,bearing_deg,"
    with TemporaryDirectory() as name:
        folder = Path(name)
        if trials:
            known = table(1, trials, columns + "true_latitude_deg,true_longitude_deg")
            (folder / "trials.csv").write_text(known, encoding="utf-8")
            read_positions(folder / "trials.csv", observers=folder / "observers.json")
        noted = table(1, tags, columns + "hidden,places")
        (folder / "noted.csv").write_text(noted, encoding="utf-8")
        found = read_positions(folder / "noted.csv")
    truth = {int(row[0]): (float(row[5]), float(row[6])) for row in _cells(noted)}
    circles = []
    for one in found:
        assert one.position is not None
        place = one.position.latitude_deg, one.position.longitude_deg
        miss_m = distance_m(*place, *truth[one.tag_id])
        circles.append(Circle(miss_m=miss_m, found=one.position))
    return circles


def _cells(table: str) -> list[list[str]]:
    return [line.split(",") for line in table.splitlines()[1:]]


def unequal_receivers(rng: Generator, receivers: int) -> tuple[Stations, tuple[float, float]]:
    """Draw a tag, and three turns of each of some receivers with unequal gains, up to 80 dB."""
    tag = (float(rng.uniform(-300.0, 300.0)), float(rng.uniform(200.0, 500.0)))
    receiver = np.repeat(np.arange(receivers), 3)
    count = len(receiver)
    east, north = rng.uniform(-300.0, 300.0, count), rng.uniform(-150.0, 150.0, count)
    height_m = np.repeat(rng.choice([1.5, 60.0], receivers), 3)
    distance_m = np.hypot(np.hypot(tag[0] - east, tag[1] - north), height_m)
    level_db = 25.0 - 25.0 * np.log10(distance_m / 100.0)
    level_db += rng.uniform(-40.0, 40.0, receivers)[receiver] + rng.normal(0.0, 3.0, count)
    bearing_deg = np.degrees(np.arctan2(tag[0] - east, tag[1] - north))
    latitude, longitude = PLANE.to_geodetic(east, north)
    stations = Stations(
        latitude_deg=latitude,
        longitude_deg=longitude,
        bearing_deg=bearing_deg + rng.normal(0.0, 4.0, count),
        sigma_deg=np.full(count, 4.0),
        level_db=level_db,
        level_sigma_db=np.full(count, 0.5),
        height_m=height_m,
        receiver=receiver,
    )
    return stations, tag


def _joint(rng: Generator, *, receivers: int) -> Circle:
    stations, tag = unequal_receivers(rng, receivers)
    found = estimate_position(stations)
    x, y = PLANE.to_local(found.latitude_deg, found.longitude_deg)
    return Circle(miss_m=float(np.hypot(x - tag[0], y - tag[1])), found=found)


def _circles(
    name: str, runs: int, seed: int, fly: Callable[[Generator], Circle], *bar: float
) -> list[Row]:
    trials = [fly(np.random.default_rng([seed, number])) for number in range(runs)]
    return _rows_of(name, trials, *bar)


def _rows_of(name: str, trials: Sequence[Circle], *bar: float) -> list[Row]:
    least, most = bar or (None, None)
    half, whole = ([float(one.holds(percent)) for one in trials] for percent in (50, 95))
    cautious = [float(bool(one.found.cautions)) for one in trials]
    return [
        measured("M1", name, "median [m]", [one.miss_m for one in trials], median),
        measured("M1", name, "50 % circle holds", half, share),
        measured("M1", name, "95 % circle holds", whole, share, least=least, most=most),
        measured("M1", name, "caution shown", cautious, share),
    ]


TURNS: dict[str, Callable[[Generator], Trial]] = {
    **{
        f"power line, {line_db:g} dB": partial(_turn, line_db=line_db)
        for line_db in (3.0, 6.0, 12.0)
    },
    "power line, 12 dB, noise unknown": partial(_turn, line_db=12.0, noise_known=False),
    **{
        f"pattern {rms_db:g} dB off": partial(_turn_of_another, rms_db=rms_db)
        for rms_db in (0.5, 1.0)
    },
    "pattern 7 dB off at the back": partial(_turn, error_db=_other_back),
    **{
        f"second path, {echo_db:g} dB": partial(
            _turn, snr_db=30.0, fading_db=0.5, echo_db=echo_db
        )
        for echo_db in (-6.0, -3.0, 0.0)
    },
}
POSITIONS: dict[str, tuple[Callable[[Generator], Circle], tuple[float, ...]]] = {
    "small survey, positions 2 m off": (partial(_small, place_sigma_m=2.0), (0.93, 0.97)),
    "small survey, positions 3 m off": (partial(_small, place_sigma_m=3.0), ()),
    "small survey, lasting and fast fading": (
        partial(_small, lasting_db=1.2, fast_db=1.2),
        (),
    ),
    "survey, even noise": (partial(_past_a_line, line_db=None), ()),
    "survey, power line of 12 dB": (partial(_past_a_line, line_db=12.0), ()),
    "survey, power line of 12 dB, noise unknown": (
        partial(_past_a_line, line_db=12.0, noise_known=False),
        (),
    ),
    **{
        f"{receivers} receivers, gains of -40 to 40 dB": (
            partial(_joint, receivers=receivers),
            (0.92, 0.98),
        )
        for receivers in (2, 3)
    },
    "observer displaced by a quarter": (_observer, ()),
    "observer displaced by a quarter, as stated": (partial(_observer, known=0.25), (0.9, 0.98)),
    "observer, headings off by up to 10°": (
        partial(_observer, shifted=0.0, turned_deg=10.0),
        (),
    ),
}

CREWS: dict[str, Callable[..., list[Circle]]] = {
    "displaced by a quarter": partial(crew, scatter_deg=10.0, share=0.25),
    "displaced by 80 m": partial(crew, scatter_deg=10.0, metres=80.0),
    "displaced by 80 m, up to 1 km": partial(
        crew, scatter_deg=10.0, metres=80.0, farthest_m=1000.0
    ),
    "not displaced": partial(crew, scatter_deg=3.0),
}
"""Worlds of people who take bearings by hand."""


def misfit_worlds(runs: int, seed: int, only: str = "") -> list[Row]:
    """M1: share of arcs and circles that contain the truth in each world, and of cautions."""
    rows = []
    for name, fly in TURNS.items():
        if only in name:
            rows += _bearings(name, runs, seed, fly)
    for name, (fly_over, bar) in POSITIONS.items():
        if only in name:
            rows += _circles(name, runs, seed, fly_over, *bar)
    for world, locate in CREWS.items():
        for trials, limits in ((20, (0.9, 0.98)), (3, ()), (0, ())):
            name = f"observer with {trials} test trials, {world}"
            if only in name:
                rngs = (np.random.default_rng([seed, one]) for one in range(-(-runs // 20)))
                each = partial(locate, trials=trials, tags=min(20, runs))
                circles = [one for rng in rngs for one in each(rng)]
                rows += _rows_of(name, circles, *limits)
    return rows
