"""How soon after its first three pulses a tag is told, as E16 counts it."""

from collections.abc import Iterator

import numpy as np

from uavrt_experiments.detection.catalogue import EXPERIMENTS
from uavrt_experiments.detection.promptness import Latencies


def streams(numbers: range) -> Iterator[Latencies]:
    (case,) = (one for one in EXPERIMENTS["E16"].cases if one.name == "20 dB, silent for 10 s")
    for number in numbers:
        yield case.trial(np.random.default_rng((5, number)), number)


def test_a_tag_that_begins_to_send_is_told_half_a_second_after_its_third_pulse() -> None:
    """Also where its first pulse ends a group of noise, and is told with those after it."""
    first_s = [one.first_s for one in streams(range(24))]
    assert len(first_s) == 24
    assert all(one is not None and one <= 0.5 for one in first_s)
