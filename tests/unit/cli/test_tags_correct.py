"""``uavrt tags correct``: flights correct a tag list."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest

from uavrt.cli.signals.tags import correct
from uavrt.config.tags.tag_files import read_tags, write_tags
from uavrt.core.messages import Beep, BeepKind, Tag, mirrored_reason
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.flight_reader import read_beeps

TAG = made.tag(2, 148_710_000.0, interval_uncertainty_s=0.06, interval_jitter_s=0.01)
OTHER = made.tag(4, 148_760_000.0, 1.0)


def flown(directory: Path, *beeps: Beep) -> Path:
    recorder = FlightRecorder.create(made.flight_info(directory, (TAG, OTHER)))
    recorder.write(*beeps)
    recorder.close()
    return directory


def measured(tag: Tag, kind: BeepKind, away_hz: float, **fields: Any) -> Beep:
    return made.beep(
        kind,
        frequency_hz=tag.frequency_hz + away_hz,
        tag_ids=(tag.tag_id,),
        offsets_hz=(away_hz,),
        **fields,
    )


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    near = {"interval_s": 1.0013, "jitter_s": 0.0012}
    return flown(
        tmp_path / "flight",
        *(
            measured(TAG, BeepKind.OFF_LABEL, away_hz, time_ns=pulses, pulses=pulses)
            for pulses, away_hz in ((12, 600.0), (30, 640.0))
        ),
        measured(OTHER, BeepKind.LISTED, 3.0, **near),
        made.beep(
            frequency_hz=148_900_000.0, interval_s=1.5, tag_ids=(2, 4), offsets_hz=(1.0, 2.0)
        ),
        measured(OTHER, BeepKind.OFF_LABEL, -6000.0, reason=mirrored_reason(4)),
    )


@pytest.fixture
def tags(tmp_path: Path) -> Path:
    """The list to be corrected."""
    write_tags(tmp_path / "tags.toml", [TAG, OTHER])
    return tmp_path / "tags.toml"


@pytest.fixture
def better(tmp_path: Path) -> Path:
    """Where the corrected list is written."""
    return tmp_path / "better.toml"


def test_the_newest_measurement_of_each_sender_is_read_back(flight: Path) -> None:
    beeps = read_beeps(flight)
    assert [(one.kind, one.pulses, one.tag_ids) for one in beeps] == [
        (BeepKind.LISTED, 12, (4,)),
        (BeepKind.OFF_LABEL, 12, (2, 4)),
        (BeepKind.OFF_LABEL, 12, (4,)),
        (BeepKind.OFF_LABEL, 30, (2,)),
    ]


def test_a_flight_corrects_the_labels_of_a_list_and_says_what_was_listed(
    flight: Path, tags: Path, better: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    correct(tags, flight, output=better)
    said = capsys.readouterr().out
    assert "tag 2: 148.710640 MHz, was 148.710000 MHz" in said
    assert "not corrected: 20 dB at 148.900000 MHz" in said
    assert "tag 4, 6.0 kHz below its label or tag 4 mirrored (I and Q swapped)?" in said
    assert [one.frequency_hz for one in read_tags(better)] == [148_710_640.0, 148_760_000.0]
    assert read_tags(tags) == (TAG, OTHER)


def test_measured_intervals_are_listed_when_asked_for_with_what_they_are_worth(
    flight: Path, tags: Path, better: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tags(tags, [TAG, made.tag(4, 148_760_000.0, 1.0, interval_uncertainty_s=0.06)])
    correct(tags, flight, output=better, intervals=True)
    said = capsys.readouterr().out
    assert "tag 4: 1001.3 ms ± 5.0 ms, jitter 3.6 ms, was 1000.0 ms ± 60.0 ms" in said
    assert "dB weaker are found" in said
    assert read_tags(better)[1].pulse_intervals_s == pytest.approx((1.0013,))


def test_a_drift_within_the_search_is_listed_from_the_newest_flight(
    tags: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drifts = (("first", 260.0, 20), ("second", 140.0, 10))
    flights = (
        flown(tmp_path / name, measured(TAG, BeepKind.LISTED, drift_hz, time_ns=time_ns))
        for name, drift_hz, time_ns in drifts
    )
    correct(tags, *flights)
    said = capsys.readouterr().out
    assert said.startswith("tag 2: 148.710260 MHz, was 148.710000 MHz\n1 tag to correct")


def test_frequency_and_interval_of_one_tag_are_corrected_together(
    flight: Path,
    tags: Path,
    better: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    again = replace(
        measured(TAG, BeepKind.LISTED, 643.0, time_ns=99, interval_s=1.2601), offsets_hz=(3.0,)
    )
    later = flown(tmp_path / "later", again)
    correct(tags, later, flight, output=better, intervals=True)
    said = capsys.readouterr().out
    assert "tag 2: 148.710643 MHz, was 148.710000 MHz\n" in said
    assert "tag 2: 1260.1 ms" in said
    assert "was 1254.0 ms" in said
    assert "2 of 2 tags corrected" in said
    corrected = read_tags(better)[0]
    assert corrected.frequency_hz == 148_710_643.0
    assert corrected.pulse_intervals_s == pytest.approx((1.2601,))


def test_one_measurement_corrects_frequency_and_interval(
    tags: Path, better: Path, tmp_path: Path
) -> None:
    flight = flown(
        tmp_path / "flight",
        measured(TAG, BeepKind.LISTED, 240.0, interval_s=1.2601),
        measured(OTHER, BeepKind.OTHER_RATE, -310.0, interval_s=0.75),
    )
    correct(tags, flight, output=better, intervals=True)
    tag, other = read_tags(better)
    assert (tag.frequency_hz, tag.pulse_intervals_s) == (148_710_240.0, (1.2601,))
    assert (other.frequency_hz, other.pulse_intervals_s) == (148_759_690.0, (1.0, 0.75))


def test_a_tag_found_at_its_label_last_is_not_moved_by_what_earlier_flights_measured(
    tags: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flights = [
        flown(tmp_path / "late", measured(TAG, BeepKind.LISTED, 20.0, time_ns=9)),
        flown(
            tmp_path / "early",
            measured(TAG, BeepKind.OFF_LABEL, 700.0, time_ns=3),
            measured(TAG, BeepKind.OTHER_RATE, 400.0, time_ns=4, interval_s=0.627),
        ),
    ]
    correct(tags, *flights)
    said = capsys.readouterr().out
    assert said.startswith("tag 2: 1254.0 and 627.0 ms")
    assert "MHz" not in said


def test_an_offset_of_all_tags_is_printed_and_no_frequency_is_corrected(
    tags: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shifted = [measured(tag, BeepKind.LISTED, 300.0) for tag in (TAG, OTHER)]
    correct(tags, flown(tmp_path / "flight", *shifted))
    said = capsys.readouterr().out
    assert "flight: the tags are +2.0 ppm off their labels" in said
    assert "lower frequency_correction_ppm by 2.0" in said
    assert "0 tags to correct" in said
