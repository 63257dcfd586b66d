"""How long a position takes: bearings, and surveys by strength, with the default priors.

Bars: 80 ms of a core for six bearings, 150 ms for twenty, 200 ms for a survey. The layouts and
surveys of experiments L2 and L7 of `uavrt experiment localization`.
"""

import time

import numpy as np

from benchmarks.harness import Table
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt_experiments.localization.circle_bars import Strengths, strengths_heard
from uavrt_experiments.localization.position_bars import survey

BARS_MS = {6: 80.0, 20: 150.0}
SURVEY_BAR_MS = 200.0
SEEDS = range(8)
"""One flight of each kind; the first is located once more before, for what is made once."""
SURVEYS = {
    "survey, 267 pulses, all heard": Strengths(name=""),
    "survey, half of the pulses too weak": Strengths(name="", too_weak=0.5),
    "survey, a tenth too weak": Strengths(name="", too_weak=0.1),
    "survey, one in fifty missed": Strengths(name="", lost=0.02),
}


def run() -> list[Table]:
    """Measure."""
    rows = []
    for count, bar_ms in BARS_MS.items():
        turns = [(_turns(np.random.default_rng(seed), count), None) for seed in SEEDS]
        rows.append(_row(f"{count} bearings", [*turns], bar_ms))
    for name, case in SURVEYS.items():
        tracks = [(None, _survey(np.random.default_rng(seed), case)) for seed in SEEDS]
        rows.append(_row(name, [*tracks], SURVEY_BAR_MS))
    return [
        Table(
            title="A position",
            header=["of", "mean", "slowest", "bar"],
            rows=rows,
            notes=[
                f"`estimate_position` with its default priors, {len(SEEDS)} flights of each; "
                "processor time of one core, without reading."
            ],
        )
    ]


def _row(
    name: str, flights: list[tuple[Stations | None, PowerTrack | None]], bar_ms: float
) -> list[str]:
    estimate_position(*flights[0])
    ms = []
    for flown in flights:
        began_s = time.process_time()
        estimate_position(*flown)
        ms.append(1e3 * (time.process_time() - began_s))
    mean = float(np.mean(ms))
    verdict = "met" if mean <= bar_ms else "NOT met"
    return [name, f"{mean:.0f} ms", f"{max(ms):.0f} ms", f"≤ {bar_ms:g} ms: {verdict}"]


def _turns(rng: np.random.Generator, count: int) -> Stations:
    """Turns around a tag, 250 to 450 m away, with bearings of 3°."""
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    radius_m = rng.uniform(250.0, 450.0, count)
    east_m, north_m = radius_m * np.sin(angle), radius_m * np.cos(angle)
    plane = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
    latitude, longitude = plane.to_geodetic(east_m, north_m)
    bearing = np.degrees(np.arctan2(-east_m, -north_m)) + rng.normal(0.0, 3.0, count)
    return Stations(
        latitude_deg=latitude,
        longitude_deg=longitude,
        bearing_deg=bearing,
        sigma_deg=np.full(count, 3.0),
        time_s=90.0 * np.arange(count, dtype=np.float64),
    )


def _survey(rng: np.random.Generator, case: Strengths) -> PowerTrack:
    """Lines 50 m apart over a square of 300 m, 40 m high, fading of 3 dB."""
    tag = (float(rng.uniform(0.0, 300.0)), float(rng.uniform(0.0, 300.0)))
    return strengths_heard(rng, survey(rng, 300.0, 50.0, 3.0, 0.0, tag), case)
