"""The tags' channels at the original's ports, from the receiver's band."""

import socket
from contextlib import suppress
from pathlib import Path

import made
import numpy as np
import pytest

from uavrt.config.settings import UdpChannelSettings
from uavrt.core.messages import Tag
from uavrt.flight.logs.detector_configs import detector_config
from uavrt.radio.channels.channel_datagram import decode_channel_datagram
from uavrt.radio.channels.channel_output import ChannelOutput
from uavrt.radio.udp_address import listen

CENTER_HZ = 148.7e6
RATE_HZ = 375_000.0
START_NS = 1_700_000_000_000_000_000


def tag(offset_hz: float, *intervals_s: float) -> Tag:
    return made.tag(2, CENTER_HZ + offset_hz, *(intervals_s or (1.254,)))


def frames_at(sock: socket.socket) -> list[tuple[int, np.ndarray]]:
    found = []
    with suppress(BlockingIOError):
        while True:
            found.append(decode_channel_datagram(sock.recv(65_536)))
    return found


def output(*tags: Tag, **settings: str) -> ChannelOutput:
    return ChannelOutput(
        UdpChannelSettings(enabled=True, **settings),  # type: ignore[arg-type]
        tags,
        band_rate_hz=RATE_HZ,
        center_frequency_hz=CENTER_HZ,
    )


def test_a_tone_leaves_at_the_port_and_frequency_of_its_channel() -> None:
    sent = output(tag(-7500.0 + 400.0))  # channel 99 of the original
    assert dict(sent.ports) == {98: [20196]}
    (listener,) = listen("127.0.0.1", 20196)
    n = np.arange(375_000)
    tone = (0.5 * np.exp(2j * np.pi * (-7100.0) / RATE_HZ * n)).astype(np.complex64)
    for first in range(0, n.size, 32_768):
        sent.process(
            made.iq_block(tone[first : first + 32_768], first, RATE_HZ, start_ns=START_NS)
        )
    frames = frames_at(listener)
    listener.close()
    sent.close()
    assert len(frames) == 3  # of 3750 samples
    samples = np.concatenate([samples for _, samples in frames])[20:]
    turn = np.angle(samples[1:] * np.conj(samples[:-1])).mean() * 3750.0 / (2 * np.pi)
    assert abs(turn - 400.0) < 0.1
    assert abs(np.abs(samples).mean() - 0.5) < 1e-3
    # Antenna time: half the filter, 1.6 ms, before the first sample of the band.
    assert abs(frames[0][0] - START_NS + 1_600_000) < 10_000
    assert sent.counters() == {"udp_channel_datagrams": 3, "udp_channel_datagrams_dropped": 0}


def test_a_tag_with_two_rates_has_two_ports_and_channels_are_not_sent_twice() -> None:
    sent = output(tag(0.0), tag(100.0), tag(3750.0, 1.0, 2.0), tag(3900.0, 1.0, 1.5))
    assert dict(sent.ports) == {0: [20000], 1: [20002, 20003]}
    sent.close()
    sent = output(tag(3750.0, 1.0, 2.0), ports="thesis")
    assert dict(sent.ports) == {1: [20001]}
    sent.close()


def test_tags_beyond_the_originals_band_are_left_out_and_counted() -> None:
    sent = output(tag(0.0), tag(250_000.0))
    assert sent.left_out == 1
    assert dict(sent.ports) == {0: [20000]}
    sent.close()
    none = output(tag(250_000.0))
    assert dict(none.ports) == {}
    none.process(made.iq_block(np.zeros(4000, np.complex64), 0, RATE_HZ, start_ns=START_NS))
    none.close()


@pytest.mark.parametrize("ports", ["current", "thesis"])
@pytest.mark.parametrize("offset_hz", [0.0, 4000.0, -4000.0, 180_000.0])
def test_the_flights_detector_config_names_the_same_port(
    tmp_path: Path, ports: str, offset_hz: float
) -> None:
    sent = output(tag(offset_hz), ports=ports)
    ((numbers),) = sent.ports.values()
    config = detector_config(tag(offset_hz), CENTER_HZ, ports=ports)  # type: ignore[arg-type]
    assert config.data_port == numbers[0]
    sent.close()
