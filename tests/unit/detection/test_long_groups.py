"""Groups of many pulses: strong tags, whose cells are all at the limit."""

from dataclasses import replace

import made
import numpy as np
import pytest
from streams import fed, sent, start_s

from uavrt.core.messages import Tag
from uavrt.detection.search.hypotheses import Candidate
from uavrt.detection.search.long_groups import LongSearch
from uavrt_experiments.detection.signals import THESIS_TAG

RATE_HZ = 3750.0
LONG = replace(
    THESIS_TAG, k=20, interval_uncertainty_s=0.000125, interval_jitter_s=0.002, tag_id=3
)


@pytest.mark.parametrize(
    ("tag", "enr_db"),
    [(replace(THESIS_TAG, k=10), 50.0), (LONG, 20.0)],
    ids=["K = 10", "K = 20"],
)
def test_each_pulse_of_a_strong_tag_is_found_where_it_is(
    tag: Tag, enr_db: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth, samples = sent(90, (tag.k + 4) * 1.254, enr_db, offset_hz=100.0)
    detector = made.detector(tag, RATE_HZ, center_frequency_hz=tag.frequency_hz - 100.0)
    most = 0
    push = LongSearch.push

    def count(self: LongSearch, *arguments: np.ndarray) -> list[Candidate]:
        nonlocal most
        found = push(self, *arguments)
        most = max(most, len(found))
        return found

    monkeypatch.setattr(LongSearch, "push", count)
    found = fed(detector, samples, block=328)
    # Each is measured on the samples: thousands took seconds of every step.
    assert 0 < most <= 8
    found += detector.flush()
    assert sorted(map(start_s, found)) == pytest.approx([p.start_s for p in truth], abs=0.002)
    assert max(abs(p.frequency_hz - tag.frequency_hz) for p in found) < 10.0
