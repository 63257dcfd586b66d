"""A tag that no group of pulses shows is found over the whole flight, and nothing else is."""

from dataclasses import replace
from pathlib import Path

import made
import numpy as np
import pytest
from command_line import Ran
from some import some
from tests.unit.whole_flight.conftest import (
    RATE_HZ,
    WINDOW_HZ,
    Rotation,
    judged,
    judged_rotation,
    rotation,
)

from uavrt.analysis.integrated.fold_pictures import write_fold_pictures
from uavrt.analysis.integrated.hindsight import parts_of
from uavrt.analysis.whole_flights.judged_flights import chance_in_words
from uavrt.analysis.whole_flights.verdict_words import where_in_words
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UavrtError
from uavrt.localization.angles import difference_deg
from uavrt.localization.whole_flight.flight_judgement import low_rank_weights, search_flight
from uavrt.localization.whole_flight.ground_cells import Cells
from uavrt.localization.whole_flight.heard_train import HeardTrain, train_pulses
from uavrt.localization.whole_flight.train_place import place_belief
from uavrt.localization.whole_flight.tuning import SEARCH
from uavrt_experiments.detection.signals import START_NS
from uavrt_experiments.detection.trials import detect
from uavrt_experiments.integrate.flights import (
    INTERVAL_S,
    World,
    add_pulses,
    looked_at,
    passing,
    silence,
    turning,
)


def test_a_tag_below_every_group_is_found_with_its_interval_and_direction(
    weak: Rotation, tmp_path: Path
) -> None:
    alone, _ = detect(weak.samples, weak.tag, frequency_window_hz=WINDOW_HZ)
    assert sum(pulse.confirmed for pulse in alone) == 0
    found = judged_rotation(weak, tmp_path)
    assert found.found
    assert found.train.false_alarm_probability < 0.01
    assert found.pulses.interval_s == pytest.approx(weak.interval_s, abs=2e-4)
    assert found.pulses.offset_hz == pytest.approx(weak.offset_hz, abs=25.0)
    place = some(found.place)
    away = abs(difference_deg(place.bearing_deg, weak.bearing_deg))
    assert away < 0.75 * place.arc95_deg < 60.0
    assert len(found.pulse_times_ns) == pytest.approx(160, abs=6)
    files = write_fold_pictures(tmp_path, [found])
    assert [file.stat().st_size > 10_000 for file in files] == [True]


def test_noise_is_nobody(tmp_path: Path) -> None:
    chances = [
        judged_rotation(rotation(seed, None), tmp_path).train.false_alarm_probability
        for seed in (20, 21)
    ]
    assert min(chances) > 0.01


@pytest.mark.parametrize(
    ("probability", "words"),
    [(0.4, "40 of 100 flights"), (0.002, "one of 500 flights"), (1e-12, "of a billion")],
)
def test_a_chance_is_said_in_flights(probability: float, words: str) -> None:
    assert words in chance_in_words(probability)


def test_poses_of_another_day_are_refused(weak: Rotation, tmp_path: Path) -> None:
    path = tmp_path / "samples.cf32"
    weak.samples[:200_000].tofile(path)
    with pytest.raises(UavrtError, match="no poses in the time"):
        judged(weak.flight, weak.tag, path, START_NS + 86_400_000_000_000)


@pytest.fixture
def on_disk(weak: Rotation, tmp_path: Path) -> list[str]:
    """The flight directory and the samples, as arguments."""
    directory = tmp_path / "flight"
    info = replace(weak.flight.info, directory=str(directory))
    made.flight(info, poses=weak.flight.poses)
    samples = tmp_path / "samples.cf32"
    weak.samples.tofile(samples)
    return [
        *("integrate", str(directory), "--recording", str(samples)),
        *("--sample-rate", str(RATE_HZ), "--center-frequency", str(weak.tag.frequency_hz)),
        *("--start-time", "2023-11-14T22:13:20Z", "--frequency-window", str(WINDOW_HZ)),
    ]


def test_the_command_prints_what_the_function_says(
    on_disk: list[str], weak: Rotation, ran: Ran
) -> None:
    (said,) = ran(*on_disk, "--json").json
    assert said["found"]
    assert said["interval_s"] == pytest.approx(weak.interval_s, abs=2e-4)
    assert len(said["integrated_pulses"]) == pytest.approx(160, abs=6)
    assert np.isfinite(said["bearing_deg"])


def test_a_flight_without_samples_and_an_unknown_tag_are_named(
    on_disk: list[str], ran: Ran
) -> None:
    assert "contains no samples" in ran(*on_disk[:2], ends=2).words
    assert "the tag list contains no tag 9" in ran(*on_disk, "--tag", 9, ends=2).words


def test_after_a_straight_pass_both_places_are_named() -> None:
    world = World(course=passing(200), slack_s=0.02, window_hz=60.0)
    rng = np.random.default_rng(12)
    samples = silence(rng, world.course)
    truth = world.truth(rng)
    add_pulses(rng, samples, world.pulses(rng, truth, 8.0))
    energies = world.energies(samples)
    train = world.judge(energies, 0.01).train
    places, chosen = looked_at(world.course)
    pulses = train_pulses(energies, train, places.gain[chosen[train.place]], places.time_s)
    place = place_belief([HeardTrain.among(energies, pulses, places, rates=1)])
    told = where_in_words(place, parts_of(place))
    assert "one of 2 places" in told[0]
    first, second = place.cells.parts()[:2]
    assert first.probability + second.probability > 0.85
    # Plane's middle is at 111 degrees west; the pass ran north.
    assert first.longitude_deg + second.longitude_deg == pytest.approx(-222.0, abs=0.002)
    assert place.cells.holds(truth.east_m, truth.north_m, 0.95)
    assert place.cells.holds(-truth.east_m, truth.north_m, 0.95)
    outlines = place.cells.outlines(0.5)
    assert outlines
    assert all(len(one) >= 5 and one[0] == one[-1] for one in outlines)


@pytest.mark.parametrize(("seed", "enr_db"), [(1, 6.0), (2, 7.0), (3, 9.0)])
def test_chosen_cells_show_the_same_train_as_all_places(seed: int, enr_db: float) -> None:
    course = turning(120)
    course = replace(course, north_m=8.0 * course.time_s)
    world = World(course=course, slack_s=0.020, window_hz=60.0)
    rng = np.random.default_rng(seed)
    samples = silence(rng, course)
    add_pulses(rng, samples, world.pulses(rng, world.truth(rng), enr_db))
    energies = world.energies(samples)
    places, chosen = looked_at(course)
    weights = low_rank_weights(places.gain[chosen], places.time_s, energies, INTERVAL_S)
    assert len(weights.basis) > SEARCH.few_patterns
    (one,) = search_flight(energies, weights, world.tag, most=1)
    every = len(weights.basis)
    (two,) = search_flight(energies, weights, world.tag, most=1, few_patterns=every)
    assert one.false_alarm_probability < 0.01
    assert one.log_probability == pytest.approx(two.log_probability, abs=1e-3)
    assert (one.place, one.interval_s, one.phase_s) == (two.place, two.interval_s, two.phase_s)


@pytest.mark.parametrize("seed", range(4))
def test_a_loud_train_goes_through_the_middles_of_its_marks(seed: int) -> None:
    """Of all trains with as many marks it was the first: 1 to 2 ms off, and at a flank."""
    rng = np.random.default_rng((15, seed))
    course = turning(45)
    world = World(course=course)
    truth = world.truth(rng)
    samples = silence(rng, course)
    add_pulses(rng, samples, world.pulses(rng, truth, 45.0))
    energies = world.energies(samples)
    places, chosen = looked_at(course)
    weights = low_rank_weights(places.gain[chosen], places.time_s, energies, INTERVAL_S)
    train = search_flight(energies, weights, world.tag)[0]
    assert train.loud
    assert train.interval_s == pytest.approx(truth.interval_s, abs=5e-4)
    assert train.offset_hz == pytest.approx(truth.offset_hz, abs=13.0)


def test_a_circle_holds_what_the_cells_hold_even_of_one_cell() -> None:
    one = Cells(
        plane=TangentPlane(latitude_deg=35.0, longitude_deg=-111.0),
        bearing_deg=np.array([40.0, 200.0]),
        range_m=np.array([1000.0, 3000.0]),
        width_deg=np.array([5.0, 5.0]),
        ratio=np.array([1.45, 1.45]),
        probability=np.array([0.96, 0.04]),
        by_fall=np.array([[0.96, 0.04]]),
    )
    (part,) = one.parts()
    rng = np.random.default_rng(1)
    bearing = np.radians(40.0 + rng.uniform(-2.5, 2.5, 20_000))
    away = 1000.0 * np.sqrt(rng.uniform(1.0 / 1.45, 1.45, 20_000))
    east, north = one.plane.to_local([part.latitude_deg], [part.longitude_deg])
    beside = np.hypot(away * np.sin(bearing) - east, away * np.cos(bearing) - north)
    assert float((beside < part.radius95_m).mean()) == pytest.approx(0.95, abs=0.03)
    (wide,) = one.radii_m(float(east[0]), float(north[0]), (0.99,))
    assert wide > 3500.0
