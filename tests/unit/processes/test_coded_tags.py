"""Coded tags in flight: a worker searches them beside others."""

import made
import numpy as np

from uavrt.config.settings import DetectionSettings
from uavrt.core.messages import Pulse
from uavrt.drone.processes.detector import DetectorBank
from uavrt.link.tunnel.tag_lists import searched_text, tag_list_digest
from uavrt_experiments.detection.coded import RATE_HZ, add_burst, some_codes
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, noise

CODES = some_codes(np.random.default_rng(4), 3)


def test_a_worker_finds_coded_tags_beside_beeping_ones() -> None:
    tag = CODES[1]
    rng = np.random.default_rng(1)
    samples = noise(rng, round(12.0 * RATE_HZ))
    add_burst(samples, tag, start_s=4.0, offset_hz=50.0, enr_db=20.0, stretch=0.0, rng=rng)
    bank = DetectorBank((*CODES, THESIS_TAG), DetectionSettings())
    found: list[Pulse] = []
    for first in range(0, len(samples), 655):
        block = made.channel_block(
            samples[first : first + 655],
            first,
            RATE_HZ,
            start_ns=START_NS,
            center_frequency_hz=tag.frequency_hz,
        )
        bank.put(block)
        found += bank.collect()
    assert [one.tag_id for one in found] == [tag.tag_id]
    assert bank.failures == 0
    assert {report.tag_id for report in bank.search_reports()} == {1, 2, 3}
    assert not bank.complete  # the beeping tag's channel has not come


def test_a_list_with_codes_is_told_by_its_digest() -> None:
    assert tag_list_digest(CODES) == tag_list_digest(CODES[::-1])
    assert tag_list_digest(CODES[:2]) != tag_list_digest(CODES[1:])
    assert searched_text(CODES).startswith("tags 1, 2, 3 (list ")
