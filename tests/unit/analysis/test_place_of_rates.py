"""What the place of a whole flight takes for granted of a tag with several rates."""

from dataclasses import replace

from uavrt.analysis.whole_flight import rates_in_words
from uavrt_experiments.detection.signals import THESIS_TAG


def test_the_place_of_a_tag_that_may_change_its_rate_carries_a_caveat() -> None:
    assert rates_in_words(replace(THESIS_TAG, pulse_intervals_s=(1.254,))) == ()
    (told,) = rates_in_words(replace(THESIS_TAG, pulse_intervals_s=(1.333, 2.0)))
    assert "the place may be far off" in told
