"""A drone says at the start of a flight which codes of its list are hard to tell apart."""

from dataclasses import replace
from pathlib import Path

import made
import pytest
from operated import Operator

from uavrt.config.settings import DetectionSettings, RadioSettings
from uavrt.core.messages import Tag

NAMED = "Codes 4000000000, 4000000001 are easily confused"


@pytest.mark.parametrize(
    ("gaps_ms", "texts", "last"),
    [
        ((22.0, 24.0), 0, None),
        ((22.0, 22.4, 30.0), 1, NAMED),
        ((22.0, 22.2, 22.4, 22.6), 4, "3 more pairs of codes are as similar"),
    ],
    ids=["far apart", "near", "many near ones"],
)
def test_near_codes_are_named_in_few_texts_that_a_radio_link_carries(
    tmp_path: Path, gaps_ms: tuple[float, ...], texts: int, last: str | None
) -> None:
    """The codes differ in their first gap."""
    operator = Operator(
        tmp_path,
        radio=RadioSettings(center_frequency_hz=166.38e6),
        detection=DetectionSettings(maximum_tags=10),
    )
    tags: list[Tag] = []
    code = made.tag(
        1,
        166_380_000.0,
        5.3,
        pulse_width_s=0.0025,
        interval_uncertainty_s=0.004,
        k=10,
        gaps_s=(0.022, 0.0488, 0.0366),
    )
    for place, gap_ms in enumerate(gaps_ms):
        gaps_s = (1e-3 * gap_ms, *code.gaps_s[1:])
        tags.append(replace(code, tag_id=4_000_000_000 + place, gaps_s=gaps_s))
    operator.detect(*tags)
    told = [text for text in operator.texts if "odes" in text]
    assert len(told) == texts
    assert told[-1:] == ([] if last is None else [last])
    assert all(len(text.encode()) <= 50 for text in told)
