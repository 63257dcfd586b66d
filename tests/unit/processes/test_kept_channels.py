"""What the process that makes the channels keeps of them, counts and tells."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from receiving import Frame, receiving

from uavrt.config.loader import parse_settings
from uavrt.config.settings import RecordingSettings
from uavrt.core.errors import ConfigError
from uavrt.core.messages import ChannelBlock
from uavrt.drone.processes.receiver import Receiver
from uavrt.drone.processes.samples.kept_channels import KeptChannels
from uavrt_experiments.resources.decimator import BandReceiver

RATE_HZ = 3e6
TAGS = tuple(
    made.tag(n, hz, 1.3)
    for n, hz in ((2, 148_710_000.0), (3, 148_710_300.0), (4, 148_760_000.0))
)
"""The first two share a channel."""


def made_receiver(
    directory: Path, kind: type[Receiver] = Receiver, **changes: Any
) -> tuple[Receiver, Frame]:
    flight = made.flight_info(
        directory, TAGS, center_frequency_hz=148.73e6, sample_rate_hz=RATE_HZ
    )
    recording = replace(RecordingSettings(minimum_free_mb=0.0), **changes)
    return receiving(flight, recording, kind)


def receive(receiver: Receiver) -> None:
    rng = np.random.default_rng(1)
    for number in range(6):
        numbers = rng.standard_normal(2 * 262_144).astype(np.float32) * np.float32(5e-3)
        receiver.process(
            made.iq_block(
                numbers.view(np.complex64), number * 262_144, RATE_HZ, start_ns=10**18
            )
        )
    receiver.close()


def test_a_receiver_keeps_each_channel_in_use_once(tmp_path: Path) -> None:
    receiver, frame = made_receiver(tmp_path)
    receive(receiver)
    kept = sorted((tmp_path / "iq" / "channels").glob("*.sigmf-data"))
    assert [int(path.name.split("_")[1]) for path in kept] == pytest.approx(
        [148_710_300, 148_760_000], abs=950
    )
    counters = receiver.counters()
    sizes = [path.stat().st_size for path in kept]
    assert sizes[0] == sizes[1]
    assert counters["kept_samples"] == sum(sizes) / 2  # 8 bits for I, 8 for Q
    assert counters["kept_samples"] == pytest.approx(2 * 7500 * 6 * 262_144 / RATE_HZ, rel=0.03)
    assert counters["kept_samples_dropped"] == 0
    assert counters["kept_mb"] == pytest.approx(sum(sizes) / 1e6)
    assert not frame.texts


@pytest.mark.parametrize(("kind", "on"), [(Receiver, False), (BandReceiver, True)])
def test_where_it_is_off_or_left_to_another_are_no_files_and_no_counters(
    tmp_path: Path, kind: type[Receiver], on: bool
) -> None:
    receiver, _ = made_receiver(tmp_path, kind, channels=on)
    receive(receiver)
    assert "kept_samples" not in receiver.counters()
    assert not (tmp_path / "iq").exists()


def channel_block(number: int) -> ChannelBlock:
    size = 60_000
    return made.channel_block(
        np.full(size, 0.1, np.complex64),
        number * size,
        3750.0,
        time_ns=10**18 + number * size * 1_000_000_000 // 3750,
        channel=1,
    )


def test_the_operator_is_told_once_when_samples_are_dropped(tmp_path: Path) -> None:
    _, frame = made_receiver(tmp_path, minimum_free_mb=1e9)
    keeping = KeptChannels(frame, frame.flight)  # type: ignore[arg-type]
    keeping.put([channel_block(0)])
    keeping.close()
    for number in range(1, 4):
        keeping.put([channel_block(number)])
    assert frame.texts == ["Disk: channel samples dropped. Detection goes on"]
    assert keeping.counters()["kept_samples_dropped"] == 4 * 60_000


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("channels = 1", "channels"),
        ('channels = "yes"', "channels"),
        ("channels_mb = 0", "channels_mb"),
        ("channels_mb = -5.0", "channels_mb"),
        ("channels_mb = nan", "channels_mb"),
    ],
)
def test_settings_that_cannot_be_are_refused_by_name(line: str, named: str) -> None:
    with pytest.raises(ConfigError, match=rf"\[recording\] {named} is"):
        parse_settings(f"[recording]\n{line}\n".encode(), name="uavrt.toml")
