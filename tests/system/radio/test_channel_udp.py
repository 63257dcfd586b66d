"""Channels by UDP whose reader waits for what is missing."""

import numpy as np
from some import some
from tests.unit.radio.test_channel_udp import (  # noqa: F401  # fixture
    block,
    source_fixture,
)

from uavrt.radio.channels.channel_sender import ChannelDatagramSender
from uavrt.radio.channels.channel_source import ChannelDatagramSource
from uavrt.radio.udp_address import parse_udp_address


def test_a_gap_within_a_frame_is_zeros_and_the_rest_of_it_a_gap_of_the_stamps(
    source: ChannelDatagramSource,
) -> None:
    sender = ChannelDatagramSender({45: [parse_udp_address(source.name)[1]]})
    sender.send(block(0, 1000))
    sender.send(block(2000, 1024, lost=1000))
    sender.close()
    first = some(source.read(1.0))
    np.testing.assert_array_equal(first.samples[:1000], np.arange(1000))
    assert not first.samples[1000:].any()
    second = some(source.read(5.0))  # held for the missing until nothing comes any more
    assert second.lost_before == 976
    assert second.sample_index == 2000
    np.testing.assert_array_equal(second.samples, np.arange(2000, 3024))
