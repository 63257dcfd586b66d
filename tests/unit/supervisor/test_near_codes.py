"""A drone says at the start of a flight which codes of its list are hard to tell apart."""

from pathlib import Path

import made

from uavrt.config.settings import DetectionSettings, RadioSettings, RecordingSettings, Settings
from uavrt.core.messages import Command


def _told(directory: Path, gaps_ms: list[float]) -> list[str]:
    """What a drone says when it begins to search for codes that differ in their first gap."""
    told: list[str] = []
    mission = made.mission(
        Settings(
            recording=RecordingSettings(directory=str(directory)),
            radio=RadioSettings(center_frequency_hz=166.38e6),
            detection=DetectionSettings(maximum_tags=10),
        ),
        directory,
        notify=lambda _severity, text: told.append(text),
    )
    tags = [
        made.tag(
            4_000_000_000 + place,
            166_380_000.0,
            5.3,
            pulse_width_s=0.0025,
            interval_uncertainty_s=0.004,
            k=10,
            gaps_s=(1e-3 * gap_ms, 0.0488, 0.0366),
        )
        for place, gap_ms in enumerate(gaps_ms)
    ]
    commands = [
        Command(name="start_tags", request_id=1, source="mavlink 255/190"),
        *(
            Command(name="add_tag", request_id=10 + n, source="mavlink 255/190", tag=tag)
            for n, tag in enumerate(tags)
        ),
        Command(name="end_tags", request_id=2, source="mavlink 255/190"),
        Command(name="start_detection", request_id=3, source="mavlink 255/190"),
    ]
    assert all(mission.command(one).accepted for one in commands)
    return [text for text in told if "odes" in text]


def test_near_codes_are_named_in_texts_that_a_radio_link_carries(tmp_path: Path) -> None:
    told = _told(tmp_path, [22.0, 22.4, 30.0])
    assert told == ["Codes 4000000000, 4000000001 are easily confused"]
    assert len(told[0].encode()) <= 50


def test_many_near_codes_do_not_fill_the_link(tmp_path: Path) -> None:
    told = _told(tmp_path, [22.0, 22.2, 22.4, 22.6])
    assert len(told) == 4
    assert told[-1] == "3 more pairs of codes are as similar"


def test_codes_that_are_far_apart_are_not_named(tmp_path: Path) -> None:
    assert _told(tmp_path, [22.0, 24.0]) == []
