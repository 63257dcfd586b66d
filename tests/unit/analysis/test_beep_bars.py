"""Short forms of the bars of the search for beeps; `uavrt_experiments` has the long ones."""

import time
from dataclasses import replace

import numpy as np
import pytest
from some import some

from uavrt.analysis.measure.measure_tag import measure_tags
from uavrt.analysis.measure.recorded_pulses import detect
from uavrt.config.ghost_places import Receiver
from uavrt.config.tags.tag_corrections import correction_of
from uavrt.core.messages import Pulse, Tag
from uavrt.detection.beeps.beep_points import Points
from uavrt.detection.beeps.beep_trains import find_trains
from uavrt_experiments.detection.beeping import (
    CENTER_HZ,
    Beeper,
    Scene,
    five,
    ghosts,
    named,
    named_live,
    names_right,
    regular,
)
from uavrt_experiments.detection.signals import THESIS_TAG

pytestmark = pytest.mark.slow


def test_five_unknown_tags_are_measured_among_carriers_voice_and_impulses() -> None:
    result = five(30.0, 250e3, seed=12)
    assert (result.right, result.wrong, result.doubtful) == (5, (), ())
    assert result.cpu_share < 0.5


@pytest.mark.parametrize("what", ["offset", "dongle", "rate"])
def test_a_wrong_label_and_a_rate_that_is_not_listed_are_named(what: str) -> None:
    assert names_right(16, what) >= 15 / 16


def test_bands_in_which_nothing_beeps_have_no_trains() -> None:
    found = ghosts(5 * 80.0 / 3600.0, 48e3, at_once_s=80.0)
    assert {kind: len(trains) for kind, trains in found.items()} == dict.fromkeys(found, 0)
    assert len(found) == 5


def test_the_cost_of_trains_grows_with_the_length() -> None:
    def spent_once_s(duration_s: float) -> float:
        rng = np.random.default_rng(6)
        tags = [regular(duration_s, interval_s, 0.5) for interval_s in (0.9, 1.1, 1.333, 2.2)]
        voice = rng.uniform(0.0, duration_s, round(5.0 * duration_s))
        times_s = np.concatenate((*tags, voice))
        frequencies_hz = np.concatenate(
            (
                *(np.full(one.size, 2e4 * place) for place, one in enumerate(tags)),
                rng.uniform(-8e3, -4e3, voice.size),
            )
        )
        points = Points(times_s, frequencies_hz, 0.0 * times_s, 20.0 + 0.0 * times_s)
        begun_s = time.process_time()
        trains, _ = find_trains(points.moved(times_s), duration_s, Receiver(0.0, 3e6))
        assert len(trains) == len(tags)
        return time.process_time() - begun_s

    def spent_s(duration_s: float) -> float:
        return min(spent_once_s(duration_s) for _ in range(2))

    # Eight times as long: it takes 8 times as much, and 64 times if it grew by the square.
    assert spent_s(200.0) < 16.0 * spent_s(25.0) + 0.1


def test_a_tag_at_the_bands_edge_is_doubtful_and_discards_no_other() -> None:
    beepers = [
        Beeper(
            offset_hz=offset_hz,
            enr_db=24.0,
            width_s=0.02,
            starts_s=regular(30.0, interval_s, 0.4),
        )
        for offset_hz, interval_s in ((4000.0, 1.1), (23_000.0, 1.3))
    ]
    found = measure_tags(lambda: Scene(duration_s=30.0, sample_rate_hz=48e3, beepers=beepers))
    (tag,) = found.tags
    assert tag.rates[0].interval_s == pytest.approx(1.1, abs=1e-4)
    (doubtful,) = found.doubtful
    assert doubtful.interval_s == pytest.approx(1.3, abs=1e-3)
    assert "edge" in str(doubtful)


def test_five_unlisted_beepers_of_15_db_anywhere_in_the_band_are_named_within_30_s() -> None:
    assert named_live(1e6, 30.0, enr_db=15.0, seed=4) == 5


def test_a_tag_off_its_label_is_detected_as_usual_after_the_label_is_corrected() -> None:
    duration_s, away_hz = 40.0, 1200.0
    beeper = Beeper(
        offset_hz=2000.0 + away_hz,
        enr_db=20.0,
        width_s=0.02,
        starts_s=regular(duration_s, 1.254, 0.4),
    )
    scene = Scene(duration_s=duration_s, sample_rate_hz=24e3, seed=8, beepers=(beeper,))
    tag = replace(THESIS_TAG, frequency_hz=CENTER_HZ + 2000.0)

    def detected(tag: Tag) -> int:
        pulses: list[Pulse] = []
        detect(replace(scene), [tag], pulses.extend)
        return len(pulses)

    assert detected(tag) == 0
    (one,) = named(replace(scene), [tag], 500.0)
    correction = some(correction_of(tag, one, 0))
    assert detected(correction.after) == beeper.starts_s.size
