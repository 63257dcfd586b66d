"""Errors of people who take bearings by hand, learnt from test trials at known places."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from some import some

from uavrt.analysis.estimates.positions import read_positions
from uavrt.core.errors import FormatError, UsageError
from uavrt.localization.estimates.flight_estimates import Found, TagBearing, place
from uavrt.localization.position.bearings.lenth import Rays
from uavrt.localization.position.bearings.observers import (
    AGREEMENT_ALONE,
    Observer,
    learn_observer,
)
from uavrt.localization.results import Bearing
from uavrt_experiments.localization.misfit_worlds import CREWS, PLANE

COLUMNS = "tag_id,observer,latitude_deg,longitude_deg,bearing_deg,"
STATIONS = ((-200.0, 0.0), (0.0, -200.0), (200.0, 0.0))
"""East and north of three stations [m] around a tag in the middle."""


def trial(
    rng: np.random.Generator, *, off_deg: float, scatter_deg: float, share: float
) -> Rays:
    away_m, first = rng.uniform(100.0, 400.0), rng.uniform(0.0, 360.0)
    angle = np.radians(first + np.arange(4) * 90.0)
    east, north = away_m * np.sin(angle), away_m * np.cos(angle)
    x, y = rng.normal(0.0, share * away_m, 2)
    bearing = np.degrees(np.arctan2(x - east, y - north)) + off_deg
    return Rays(east_m=east, north_m=north, bearing_deg=bearing + rng.normal(0, scatter_deg, 4))


@cache
def learnt(count: int, scatter_deg: float, share: float) -> Observer:
    """Errors by test trials of a person whose bearings are 6° off."""
    rng = np.random.default_rng(7)
    trials = [
        trial(rng, off_deg=6.0, scatter_deg=scatter_deg, share=share) for _ in range(count)
    ]
    return learn_observer("Ada", trials)


@pytest.mark.parametrize(("scatter_deg", "share"), [(10.0, 0.25), (3.0, 0.0)])
def test_twenty_trials_show_scatter_common_error_and_displacement(
    scatter_deg: float, share: float
) -> None:
    found = learnt(20, scatter_deg, share)
    assert found.scatter_deg == pytest.approx(scatter_deg, rel=0.3)
    assert abs(found.heading_error_deg - 6.0) < 3.0 * found.heading_error_sigma_deg
    assert found.heading_error_sigma_deg < 2.0
    assert found.displaced == pytest.approx(share, abs=0.06)
    assert sum(one[0] for one in found.displacements) == pytest.approx(1.0)


def test_few_trials_leave_more_open_than_many() -> None:
    few, many = learnt(2, 10.0, 0.25), learnt(20, 10.0, 0.25)
    assert few.heading_error_sigma_deg > 1.3 * many.heading_error_sigma_deg

    def plausible(observer: Observer) -> int:
        return sum(one[0] > 0.02 for one in observer.displacements)

    assert plausible(few) > 1.5 * plausible(many)


@pytest.mark.parametrize("world", CREWS)
def test_circles_of_a_tested_observer_hold_95_percent(world: str) -> None:
    found = CREWS[world](np.random.default_rng(11), trials=20)
    held = sum(one.holds(95) for one in found)
    # Chance of fewer than 16 of 20 for a true 95 %: 0.3 %.
    assert len(found) == 20
    assert held >= 16
    assert not any(AGREEMENT_ALONE in one.found.cautions for one in found)


def test_circles_of_an_unknown_observer_say_what_they_rest_on_and_miss() -> None:
    """The test of the circles can fail: without test trials they are too small."""
    found = CREWS["displaced by a quarter"](np.random.default_rng(11), trials=0)
    assert sum(one.holds(95) for one in found) <= 15
    assert all(AGREEMENT_ALONE in one.found.cautions for one in found)


def table(path: Path, observer: str, *, truth: bool, turned_deg: float = 0.0) -> Path:
    """Write bearings of one tag to the middle, as a test trial if `truth`."""
    lines = [COLUMNS + "true_latitude_deg,true_longitude_deg"]
    for east, north in STATIONS:
        latitude, longitude = PLANE.to_geodetic(east, north)
        bearing = np.degrees(np.arctan2(-east, -north)) + turned_deg
        known = f"{PLANE.latitude_deg},{PLANE.longitude_deg}" if truth else ","
        lines.append(f"1,{observer},{latitude},{longitude},{bearing},{known}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_errors_are_kept_by_name_and_used_for_tables_next_to_the_file(tmp_path: Path) -> None:
    kept = tmp_path / "observers.json"
    said: list[str] = []
    trials = table(tmp_path / "trials.csv", "Ada", truth=True, turned_deg=8.0)
    assert read_positions(trials, observers=kept, warn=said.append) == []
    assert "Ada by 1 test trial" in said[0]
    other = table(tmp_path / "others.csv", "Grace", truth=True)
    read_positions(other, observers=kept)
    assert [one["name"] for one in json.loads(kept.read_text())] == ["Ada", "Grace"]

    noted = table(tmp_path / "noted.csv", "Ada", truth=False)
    before = kept.read_bytes()
    (one,) = read_positions(noted)
    position = some(one.position)
    assert position.listeners == (said[0],)
    assert AGREEMENT_ALONE not in position.cautions
    assert kept.read_bytes() == before
    (tmp_path / "empty.json").write_text("[]", encoding="utf-8")
    (elsewhere,) = read_positions(noted, observers=tmp_path / "empty.json")
    assert AGREEMENT_ALONE in some(elsewhere.position).cautions
    assert (tmp_path / "empty.json").read_text(encoding="utf-8") == "[]"


def test_test_trials_count_for_other_tables_of_the_same_call(tmp_path: Path) -> None:
    trials = table(tmp_path / "trials.csv", "Ada", truth=True)
    noted = table(tmp_path / "noted.csv", "Ada", truth=False)
    (one,) = read_positions(trials, noted)
    assert some(one.position).stations == len(STATIONS)
    assert some(one.position).listeners


def test_a_test_trial_needs_a_name_and_a_damaged_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"line 2: a test trial needs an observer"):
        read_positions(table(tmp_path / "trials.csv", "", truth=True))
    (tmp_path / "observers.json").write_text('[{"name": "Ada"}]', encoding="utf-8")
    noted = table(tmp_path / "noted.csv", "Ada", truth=False)
    with pytest.raises(FormatError, match=r"observers\.json"):
        read_positions(noted)


def test_a_missing_file_of_observers_is_named(tmp_path: Path) -> None:
    table = tmp_path / "noted.csv"
    table.write_text(COLUMNS + "\n2,Ada,46.5,8.0,90,\n2,Ada,46.501,8.0,135,\n")
    with pytest.raises(UsageError, match=r"gone\.json does not exist"):
        read_positions(table, observers=tmp_path / "gone.json")


def test_bearings_of_a_displaced_observer_count_little_next_to_others() -> None:
    ada = replace(learnt(20, 10.0, 0.25), heading_error_deg=0.0)

    def bearings(
        target: tuple[float, float], number: int, by: Observer | None
    ) -> list[TagBearing]:
        taken = []
        for station, (east, north) in enumerate(STATIONS):
            latitude, longitude = PLANE.to_geodetic(east, north)
            bearing = np.degrees(np.arctan2(target[0] - east, target[1] - north))
            taken.append(
                TagBearing(
                    tag_id=1,
                    bearing=Bearing(
                        bearing_deg=float(bearing), method="noted", pulses=0, sigma_deg=3.0
                    ),
                    latitude_deg=float(latitude),
                    longitude_deg=float(longitude),
                    altitude_amsl_m=0.0,
                    start_time_ns=number + station,
                    middle_time_ns=number + station,
                    end_time_ns=number + station,
                    by_hand=by is not None,
                    observer=by,
                )
            )
        return taken

    drone, person = bearings((0.0, 0.0), 0, None), bearings((60.0, 60.0), 10, ada)
    exact = [replace(one, observer=None) for one in person]

    def miss_m(*together: list[TagBearing]) -> float:
        (one,) = place([Found(bearings=[each for some_of in together for each in some_of])])
        found = some(one.position)
        return float(np.hypot(*PLANE.to_local(found.latitude_deg, found.longitude_deg)))

    assert miss_m(drone, person) < 15.0
    assert miss_m(drone, exact) > 25.0
