"""The report lists what beeped beside the tags of a flight."""

from pathlib import Path

import made
import pytest

from uavrt.analysis.report import report_words as words
from uavrt.analysis.report.report_page import html_page
from uavrt.analysis.survey import read_survey
from uavrt.core.messages import BeepKind
from uavrt.flight.flight_recorder import FlightRecorder

pytestmark = pytest.mark.slow


def test_a_report_has_a_line_for_each_odd_sender_and_none_for_listed_ones(
    tmp_path: Path,
) -> None:
    tag = made.tag(2, 148_710_000.0, 1.254)
    recorder = FlightRecorder.create(made.flight_info(tmp_path / "flight", (tag,)))
    for beep in (
        made.beep(frequency_hz=148_710_640.0, tag_ids=(2,), offsets_hz=(640.0,)),
        made.beep(BeepKind.UNLISTED, frequency_hz=148_935_200.0, interval_s=1.102),
        made.beep(BeepKind.LISTED, tag_ids=(2,), offsets_hz=(3.0,)),
    ):
        recorder.write(beep)
    recorder.close()
    survey = read_survey(tmp_path / "flight")
    table = words.beep_table(survey)
    assert table is not None
    assert [row[1:] for row in table[1]] == [
        ["148.710640", "1254", "12", "20", "tag 2, 640 Hz above its label"],
        ["148.935200", "1102", "12", "20", "unlisted"],
    ]
    assert "Other beeping signals" in html_page(survey)


def test_a_report_names_an_offset_of_all_tags_although_each_is_found_as_listed(
    tmp_path: Path,
) -> None:
    tags = made.tag(2, 148_710_000.0), made.tag(4, 148_760_000.0)
    recorder = FlightRecorder.create(made.flight_info(tmp_path / "flight", tags))
    for tag in tags:
        recorder.write(
            made.beep(
                BeepKind.LISTED,
                frequency_hz=tag.frequency_hz + 300.0,
                tag_ids=(tag.tag_id,),
                offsets_hz=(300.0,),
            )
        )
    recorder.close()
    table = words.beep_table(read_survey(tmp_path / "flight"))
    assert table is not None
    (row,) = table[1]
    assert row[-1].startswith("the tags are +2.0 ppm off their labels: the receiver's")
