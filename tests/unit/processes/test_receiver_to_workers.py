"""What the receiver does to a strong tag is known in the workers that search the tags."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import numpy as np
from numpy.typing import NDArray
from receiving import Frame

from uavrt.config.ghost_places import Receiver as GhostPlaces
from uavrt.config.settings import DetectionSettings, RecordingSettings
from uavrt.core.messages import Pulse, Tag
from uavrt.drone.ipc.sample_datagrams import ChannelReceiver, ChannelSender
from uavrt.drone.processes.detector import DetectorBank
from uavrt.drone.processes.receiver import Receiver
from uavrt.drone.supervisor.mission.flight_opening import share_tags
from uavrt.drone.supervisor.tree.process_tree import make_sample_sockets
from uavrt_experiments.detection.signals import make_samples

RATE_HZ = 96_000.0
CENTER_HZ = 148_700_000.0
START_NS = 1_700_000_000_000_000_000
DURATION_S = 16.0
TAGS = tuple(
    made.tag(tag_id, CENTER_HZ + offset_hz, interval_s, interval_uncertainty_s=0.06)
    for tag_id, offset_hz, interval_s in ((2, 20_300.0, 1.254), (4, 17_800.0, 1.6))
)
MIRROR = replace(TAGS[0], tag_id=6, frequency_hz=CENTER_HZ - 20_300.0)


def samples_of(enr_db: tuple[float, float]) -> NDArray[np.complex64]:
    """Both tags as 8 bits with noise of six steps hold them: strong pulses are cut."""
    rng = np.random.default_rng(3)
    pulses = [
        pulse
        for tag, level_db in zip(TAGS, enr_db, strict=True)
        for pulse in made.train(
            rng,
            DURATION_S,
            level_db,
            interval_s=tag.pulse_intervals_s[0],
            offset_hz=tag.frequency_hz - CENTER_HZ,
            jitter_s=0.001,
        )
    ]
    samples = make_samples(rng, pulses, duration_s=DURATION_S, sample_rate_hz=RATE_HZ)
    values = np.clip(np.round(samples.view(np.float32) * 6.0), -128, 127) / 128.0
    return values.astype(np.float32).view(np.complex64)


def flown(
    directory: Path, samples: NDArray[np.complex64], shares: Sequence[Sequence[Tag]]
) -> dict[int, list[Pulse]]:
    """Pulses of each tag, found by workers by way of the receiver's sockets."""
    tags = tuple(tag for share in shares for tag in share)
    flight = made.flight_info(
        directory,
        tags,
        start_time_ns=START_NS,
        center_frequency_hz=CENTER_HZ,
        sample_rate_hz=RATE_HZ,
    )

    workers = {tag.tag_id: number for number, share in enumerate(shares) for tag in share}
    frame: Any = Frame(flight, RecordingSettings(directory=str(directory)), workers)
    roads = [make_sample_sockets() for _ in shares]
    receiver = Receiver(frame, flight, [ChannelSender(ours) for ours, _ in roads])
    ends = [ChannelReceiver(theirs) for _, theirs in roads]
    banks = [DetectorBank(tuple(share), DetectionSettings(), flight) for share in shares]
    found: list[Pulse] = []
    size = 8192
    for start in range(0, len(samples), size):
        receiver.process(
            made.iq_block(samples[start : start + size], start, RATE_HZ, start_ns=START_NS)
        )
        for end, bank in zip(ends, banks, strict=True):
            while blocks := end.receive():
                for block in blocks:
                    bank.put(block)
            found += bank.collect()
    for bank in banks:
        found += bank.flush()
    for road in roads:
        for sock in road:
            sock.close()
    return {tag.tag_id: [p for p in found if p.tag_id == tag.tag_id] for tag in tags}


def test_a_pulse_at_the_converters_limits_is_marked_and_another_tags_is_not(
    tmp_path: Path,
) -> None:
    found = flown(tmp_path, samples_of((68.0, 25.0)), [TAGS[:1], TAGS[1:]])
    strong, weak = ([pulse for pulse in found[tag.tag_id] if pulse.confirmed] for tag in TAGS)
    assert len(strong) >= 10
    assert all(pulse.clipped for pulse in strong)
    apart = [
        pulse
        for pulse in weak
        if all(abs(pulse.start_time_ns - p.start_time_ns) > 50e6 for p in strong)
    ]
    assert len(apart) >= 6
    assert not any(pulse.clipped for pulse in apart)


def test_no_pulse_is_marked_while_the_converter_is_within_its_limits(tmp_path: Path) -> None:
    found = flown(tmp_path, samples_of((30.0, 25.0)), [TAGS[:1], TAGS[1:]])
    assert all(len(pulses) >= 8 for pulses in found.values())
    assert not any(pulse.clipped for pulses in found.values() for pulse in pulses)


def test_the_image_of_a_strong_tag_is_known_with_two_workers(tmp_path: Path) -> None:
    samples = samples_of((46.0, 20.0))
    samples = samples + np.float32(10.0**-1.5) * np.conj(samples)
    receiver = GhostPlaces(CENTER_HZ, RATE_HZ)
    shares = share_tags((*TAGS, MIRROR), 2, window_hz=1000.0, receiver=receiver)
    assert [sorted(tag.tag_id for tag in share) for share in shares] == [[2, 6], [4]]
    found = flown(tmp_path, samples, shares)
    assert sum(pulse.confirmed for pulse in found[2]) >= 10
    assert not any(pulse.confirmed for pulse in found[6])
    assert sum(pulse.ghost_of_tag_id == 2 for pulse in found[6]) >= 8
