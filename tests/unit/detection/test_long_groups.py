"""Groups of many pulses: strong tags, whose cells are all at the limit."""

from dataclasses import replace

import made
import numpy as np
import pytest

from uavrt.core.messages import Tag
from uavrt.detection.search.hypotheses import Candidate
from uavrt.detection.search.long_groups import LongSearch
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, make_samples

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
    rng = np.random.default_rng(90)
    duration_s = (tag.k + 4) * 1.254
    sent = made.train(rng, duration_s, enr_db, offset_hz=100.0)
    samples = make_samples(rng, sent, duration_s=duration_s)
    detector = made.detector(tag, RATE_HZ, center_frequency_hz=tag.frequency_hz - 100.0)
    most = 0
    push = LongSearch.push

    def count(self: LongSearch, *arguments: np.ndarray) -> list[Candidate]:
        nonlocal most
        found = push(self, *arguments)
        most = max(most, len(found))
        return found

    monkeypatch.setattr(LongSearch, "push", count)
    found = []
    for first in range(0, len(samples), 328):
        time_ns = START_NS + round(first / RATE_HZ * 1e9)
        found += detector.process(samples[first : first + 328], time_ns)
    # Each is measured on the samples: thousands took seconds of every step.
    assert 0 < most <= 8
    found += detector.flush()
    assert len(found) == len(sent)
    off_s = [
        (pulse.start_time_ns - START_NS) * 1e-9 - true.start_s
        for pulse, true in zip(sorted(found, key=lambda p: p.start_time_ns), sent, strict=True)
    ]
    assert np.abs(off_s).max() < 0.002
    assert max(abs(p.frequency_hz - tag.frequency_hz) for p in found) < 10.0
