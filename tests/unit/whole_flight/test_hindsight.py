"""Pulses seen in hindsight are marked wherever pulses are read, and never mixed with others."""

import hashlib
import io
import json
import math
import zipfile
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import made
import numpy as np
import pytest
from report_text import draw_in_report, pictures_in_report, said_in_report
from tests.unit.whole_flight.conftest import Rotation, judged_rotation, rotation

from uavrt.analysis.export.kmz import kmz_bytes
from uavrt.analysis.export.written import export_survey
from uavrt.analysis.integrated.fold_pictures import fold_of
from uavrt.analysis.integrated.hindsight import integrated_pulses, save_integrated, slots_of
from uavrt.analysis.survey import read_survey
from uavrt.analysis.whole_flights.judged_flights import IntegratedTag
from uavrt.cli.results.integrated_words import sentence
from uavrt.core.clock import parse_iso_intervals
from uavrt.core.errors import FormatError, RecordingError
from uavrt.core.messages import Pulse, PulsePose
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.integrated import read_folds, read_integrated
from uavrt.flight.logs.pulse_files import read_pulse_file
from uavrt.flight.reading.flight_reader import Flight, read_flight
from uavrt.flight.reading.recognise import read_pulse_log
from uavrt.localization.whole_flight.train_judging import OtherTrain

LIVE = 4
"""Pulses of the train that the flight's own log has."""


@pytest.fixture(scope="module")
def result(weak: Rotation, tmp_path_factory: pytest.TempPathFactory) -> IntegratedTag:
    return judged_rotation(weak, tmp_path_factory.mktemp("judged"))


@pytest.fixture
def flight(weak: Rotation, result: IntegratedTag, tmp_path: Path) -> Flight:
    """A flight on the disk that heard some of the train's pulses itself."""
    directory = tmp_path / "flight_log_2023-11-14_22-13-20"
    heard = [
        PulsePose(pulse=live_pulse(weak.tag.tag_id, int(time_ns) + 6_000_000), pose=None)
        for time_ns in result.pulse_times_ns[20 : 20 + LIVE]
    ]
    info = replace(weak.flight.info, directory=str(directory))
    return read_flight(made.flight(info, poses=weak.flight.poses, pulse_poses=heard))


def live_pulse(tag_id: int, time_ns: int) -> Pulse:
    return made.pulse(
        time_ns,
        tag_id=tag_id,
        frequency_hz=148.7e6,
        snr_db=9.0,
        score=1.1,
        detection_status="detected",
        confirmed=False,
    )


def test_they_lie_beside_the_flight_whose_own_log_stays_as_it_was(
    flight: Flight, result: IntegratedTag
) -> None:
    root = Path(flight.info.directory)

    def own_log() -> dict[str, str]:
        files = [path for path in sorted(root.rglob("*")) if path.is_file()]
        inside = FlightLayout(root).integrated_directory
        return {
            str(path): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in files
            if not path.is_relative_to(inside)
        }

    before = own_log()
    assert read_integrated(root) == ((), ())
    save_integrated(flight, [result])
    assert own_log() == before
    (verdict,), pulses = read_integrated(root)
    assert verdict.found
    assert verdict.heard_live == LIVE
    supported = slots_of(result).supported
    assert verdict.pulses == len(pulses) == supported.sum() - supported[20 : 20 + LIVE].sum()
    assert 15 < verdict.pulses < 0.5 * len(result.pulse_times_ns)
    assert {one.pulse.detection_status for one in pulses} == {"integrated"}
    assert not any(one.pulse.confirmed for one in pulses)
    posed = sum(one.pose is not None for one in pulses)
    assert posed >= len(pulses) - 2
    assert read_pulse_file(root / "integrated" / "pulses.jsonl") == pulses


def test_a_train_that_may_be_the_tags_own_is_kept_with_the_verdict(
    flight: Flight, result: IntegratedTag
) -> None:
    twice = OtherTrain(
        interval_s=1.881, phase_s=0.1, offset_hz=0.0, drift=0.0, loud=True, ratio=(3, 2)
    )
    save_integrated(flight, [replace(result, found=False, place=None, others=(twice,))])
    (verdict,), _ = read_integrated(flight.info.directory)
    assert verdict.ambiguous
    assert "every 1.8810 s (3/2 of its interval)" in verdict.remarks
    # The channel was recorded from the flight's beginning to its end.
    (heard,) = parse_iso_intervals(verdict.listened)
    assert heard[1] - heard[0] > 0.98 * (flight.poses[-1].time_ns - flight.poses[0].time_ns)


def test_a_tag_of_two_rates_has_pulses_only_where_it_was_at_that_rate(tmp_path: Path) -> None:
    flown = rotation(5, 24.0, pulses=96, then_s=0.987)
    directory = str(tmp_path / "flight_log_2023-11-14_22-13-20")
    flight = replace(flown.flight, info=replace(flown.flight.info, directory=directory))
    one = judged_rotation(replace(flown, flight=flight), tmp_path)
    assert one.found
    assert one.train.rate in (1, 2)
    slots, time_s = slots_of(one), one.pulses.time_s
    half_s = 0.5 * 96 * one.tag.pulse_intervals_s[0] - 0.1
    there = time_s < half_s if one.train.rate == 1 else time_s >= half_s
    assert float((slots.at_rate == there).mean()) > 0.95
    assert not slots.supported[~there].any()
    assert float(slots.supported[there].mean()) > 0.4
    told = sentence(one)
    assert f"{len(time_s)} slots, one every" in told
    assert f"at its rate {one.train.rate}, used in {slots.at_rate.sum()} of them" in told
    # Pulses told in flight some 50 ms beside the slots are these slots' all the same.
    live = [
        PulsePose(pulse=live_pulse(one.tag.tag_id, int(time_ns) + 54_000_000), pose=None)
        for time_ns in one.pulse_times_ns
    ]
    assert len(integrated_pulses(flight, one)) == slots.supported.sum()
    assert integrated_pulses(replace(flight, pulse_poses=tuple(live)), one) == []


def test_the_fold_of_a_loud_tag_shows_its_pulses(tmp_path: Path) -> None:
    loud = judged_rotation(rotation(4, 36.0, pulses=60), tmp_path)
    assert loud.found
    fold = fold_of(loud)
    middle = len(fold.profile) // 2
    assert abs(np.argmax(fold.profile) - middle) <= 2
    assert max(fold.profile) > 20.0
    near = [max(row[middle - 2 : middle + 3]) for row in fold.raster]
    assert sum(value > 5.0 for value in near) > 0.6 * len(near)


def test_nothing_is_counted_twice_however_often_it_is_judged_rotation(
    flight: Flight, result: IntegratedTag
) -> None:
    for _ in range(3):
        save_integrated(flight, [result])
    survey = read_survey(flight.info.directory)
    assert len(survey.pulse_poses) == LIVE
    slots = slots_of(result).supported
    further = slots.sum() - slots[20 : 20 + LIVE].sum()
    assert len(survey.every_pulse) == LIVE + further
    times = [one.pulse.start_time_ns for one in survey.every_pulse]
    assert times == sorted(times)
    assert min(b - a for a, b in pairwise(times)) > 1_000_000_000


def test_a_tag_that_is_not_found_any_more_loses_its_pulses_and_others_keep_theirs(
    flight: Flight, result: IntegratedTag
) -> None:
    other = replace(result, tag=replace(result.tag, tag_id=77))
    save_integrated(flight, [result, other])
    save_integrated(flight, [replace(result, found=False, place=None)])
    verdicts, pulses = read_integrated(flight.info.directory)
    assert [(one.tag_id, one.found) for one in verdicts] == [
        (result.tag.tag_id, False),
        (77, True),
    ]
    assert {one.pulse.tag_id for one in pulses} == {77}


def test_bearings_and_positions_are_those_of_the_pulses_heard_in_flight(
    flight: Flight, result: IntegratedTag
) -> None:
    before = read_survey(flight.info.directory)
    save_integrated(flight, [result])
    after = read_survey(flight.info.directory)
    assert after.bearings == before.bearings == ()
    assert after.positions == before.positions


def test_every_export_marks_them(flight: Flight, result: IntegratedTag, tmp_path: Path) -> None:
    save_integrated(flight, [result])
    survey = read_survey(flight.info.directory)
    export_survey(survey, tmp_path / "out", ["csv", "uavrt", "geojson", "geopackage"])
    count = len(survey.integrated)
    table = (tmp_path / "out" / "pulses.csv").read_text().splitlines()
    assert sum(",integrated," in line for line in table) == count
    assert sum(",detected," in line for line in table) == LIVE
    told = json.loads((tmp_path / "out" / "flight.geojson").read_text())["features"]
    marked = [one for one in told if one["properties"].get("detection_status") == "integrated"]
    placed = [one for one in survey.integrated if one.pose is not None]
    assert len(marked) == len(placed)
    back = read_pulse_log(tmp_path / "out" / "Pulse-uavrt.csv").pulse_poses
    assert sum(one.pulse.detection_status == "integrated" for one in back) == len(placed)
    with zipfile.ZipFile(io.BytesIO(kmz_bytes(survey))) as archive:
        text = archive.read("doc.kml").decode()
        assert "pulses found after the flight (integrated)" in text
        assert text.count("<styleUrl>#integrated</styleUrl>") == len(placed)
        assert "files/ring.png" in archive.namelist()


def test_the_report_tells_of_them_and_how_they_were_found(
    flight: Flight, result: IntegratedTag
) -> None:
    save_integrated(flight, [result])
    told = said_in_report(read_survey(flight.info.directory))
    assert "Whole flight found" in told
    assert "False alarms" in told
    _, pulses = read_integrated(flight.info.directory)
    assert f"{len(pulses)} found after the flight" in told
    assert "After the flight. `uavrt integrate` combined all pulses" in told


def test_pulses_that_do_not_stand_out_of_the_noise_are_not_told(
    flight: Flight, result: IntegratedTag
) -> None:
    save_integrated(flight, [result])
    _, pulses = read_integrated(flight.info.directory)
    # Noise has the largest of some exponentials in a slot: one of twenty is above 4 dB.
    assert all(one.pulse.snr_db > 3.0 for one in pulses)
    assert all(math.isnan(one.pulse.noise_psd) for one in pulses)


def test_a_place_that_cannot_be_written_is_named(flight: Flight, result: IntegratedTag) -> None:
    (Path(flight.info.directory) / "integrated").write_text("a file")
    with pytest.raises(RecordingError, match=r"cannot write .*integrated"):
        save_integrated(flight, [result])


def test_the_fold_lies_beside_the_flight_and_is_drawn_in_the_report(
    flight: Flight, result: IntegratedTag
) -> None:
    directory = flight.info.directory
    assert read_folds(directory) == ()
    save_integrated(flight, [result, replace(result, tag=replace(result.tag, tag_id=77))])
    save_integrated(flight, [result])
    own, other = read_folds(directory)
    assert (own.tag_id, other.tag_id) == (result.tag.tag_id, 77)
    assert own.interval_s == result.pulses.interval_s
    assert 20 <= len(own.raster) <= 32
    # The train is in the middle, in every part of the flight that heard it.
    middle = len(own.profile) // 2
    assert abs(np.argmax(own.profile) - middle) <= 2
    assert max(own.profile) > 6.0 > 2.5 * abs(own.profile[5])
    survey = read_survey(directory)
    title = f"Tag {result.tag.tag_id} over the whole flight"
    assert title in said_in_report(survey)
    (picture, _) = (one for one in pictures_in_report(survey) if "folded" in one.name)
    assert picture.name.startswith(title)
    assert "A tag shows as a vertical line" in picture.caption
    assert draw_in_report(survey, title).axes


FOLD = '[{"tag_id": 2, "interval_s": 1.2, "length_s": 9, "profile": [1, 2], "raster": [[1]]}]'


@pytest.mark.parametrize(
    ("name", "read", "content"),
    [
        *(
            ("tags", read_integrated, content)
            for content in ("{", "[1]", '[{"tag_id": 2}]', '{"tag_id": 2}')
        ),
        *(("folds", read_folds, content) for content in ("{", '[{"tag_id": 2}]', FOLD)),
        ("folds", read_folds, FOLD.replace("[1, 2]", "[NaN]")),
        ("folds", read_folds, FOLD.replace("[1, 2]", "[]").replace("[[1]]", "[[]]")),
        ("folds", read_folds, FOLD.replace("[1, 2]", "[1]").replace("1.2", "0")),
    ],
)
def test_damaged_results_are_named_and_the_flight_is_read_all_the_same(
    flight: Flight,
    result: IntegratedTag,
    name: str,
    read: Callable[[str], object],
    content: str,
) -> None:
    directory = save_integrated(flight, [result])
    (directory / f"{name}.json").write_text(content)
    with pytest.raises(FormatError, match=rf"{name}\.json cannot be read"):
        read(flight.info.directory)
    survey = read_survey(flight.info.directory)
    assert len(survey.pulse_poses) == LIVE
    assert survey.folds == ()
    assert any("Whole-flight results cannot be read" in text for text in survey.warnings)
