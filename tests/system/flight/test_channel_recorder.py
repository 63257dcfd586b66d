"""Kept channels: what the writing thread makes of samples that come bit by bit."""

import json
import os
import time
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import made
import numpy as np
import pytest
import sigmf
from forked import forked
from numpy.typing import NDArray
from tests.unit.flight.test_channel_recorder import (
    CENTER_HZ,
    RATE_HZ,
    START_NS,
    blocks,
    keep,
    noise,
    pieces,
    read,
    recorder,
)
from until import until

from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.samples import channel_recorder
from uavrt.flight.samples.channel_recorder import ChannelRecorder
from uavrt.radio.opening import open_recording


@pytest.fixture(autouse=True)
def soon_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let samples wait for 0.1 s in place of 2: many tests wait until they are on the disk."""
    monkeypatch.setattr(channel_recorder, "FLUSH_S", 0.1)


def put(keeping: ChannelRecorder, sent: NDArray[np.complex64], first: int = 0) -> None:
    """Until they are taken."""
    for some in blocks(sent, first=first):
        keeping.put([some])
    until(lambda: not keeping._waiting_bytes)


def store(keeping: ChannelRecorder, sent: NDArray[np.complex64], first: int = 0) -> None:
    """Until they are on the disk."""
    put(keeping, sent, first)
    end = first + len(sent)
    until(lambda: keeping.written_samples + keeping.dropped_samples >= end)


def test_a_signal_that_grows_is_never_clipped(tmp_path: Path) -> None:
    grows = noise(60_000) + np.geomspace(1e-4, 1.0, 60_000).astype(np.complex64)
    keeping = recorder(tmp_path / "flight")
    store(keeping, grows[:30_000])  # the second half meets a file that is open
    store(keeping, grows[30_000:], 30_000)
    keeping.close()
    parts = [read(path) for path in pieces(tmp_path / "flight")]
    assert len(parts) == 2
    back = np.concatenate(parts)
    assert np.abs(back - grows).max() < 1e-4
    formats = [json.loads(path.read_text()) for path in pieces(tmp_path / "flight")]
    assert [one["global"]["core:datatype"] for one in formats] == ["ci16_le", "ci16_le"]


def test_noise_that_falls_is_kept_in_finer_steps(tmp_path: Path) -> None:
    flight = tmp_path / "flight"
    sent = noise(30_000)
    sent[15_000:] *= 0.1
    keeping = recorder(flight)
    keeping.put(blocks(sent[:1])[:1])
    for part in (slice(1, 22_500), slice(22_500, 30_000)):
        store(keeping, sent[part], part.start)
    keeping.close()
    last = read(pieces(flight)[-1])
    assert len(pieces(flight)) > 1
    added = np.mean(np.abs(last - sent[-len(last) :]) ** 2) / (2.0 * 1e-10)
    assert 10.0 * np.log10(1.0 + added) < 0.05


def test_a_strong_signal_takes_16_bits_only_while_it_lasts(tmp_path: Path) -> None:
    flight = tmp_path / "flight"
    sent = noise(150_000)
    sent[60_000:65_000] += np.complex64(1e-2)
    keeping = recorder(flight)
    for first in range(0, len(sent), 7_500):
        store(keeping, sent[first : first + 7_500], first)
    keeping.close()
    kept = pieces(flight)
    formats = [json.loads(path.read_text())["global"]["core:datatype"] for path in kept]
    assert formats[0] == "ci8"
    assert formats[1] == "ci16_le"
    assert formats[-1] == "ci8"
    back = np.concatenate([read(path) for path in kept])
    added = np.mean(np.abs(back - sent) ** 2) / np.mean(np.abs(noise(15_000)) ** 2)
    assert 10.0 * np.log10(1.0 + added) < 0.05


def test_a_radio_that_gives_nothing_but_zeros_ends_nothing(tmp_path: Path) -> None:
    flight = tmp_path / "flight"
    sent = noise(30_000)
    sent[:15_000] = 0.0
    keeping = recorder(flight)
    put(keeping, sent[:15_000])  # the zeros are taken by themselves
    put(keeping, sent[15_000:], 15_000)
    keeping.close()
    assert keeping.trouble is None
    assert keeping.dropped_samples == 0
    back = np.concatenate([read(path) for path in pieces(flight)])
    assert np.abs(back[-15_000:] - sent[15_000:]).max() < np.std(sent[15_000:].real) / 4.0


@pytest.mark.parametrize("lost", [0.3, 0.55, 0.9, 0.99])
def test_samples_lost_in_between_do_not_count_as_silence(tmp_path: Path, lost: float) -> None:
    """Zeros stand for them: if they were noise, all that comes beside would be loud."""
    sent = noise(30_000)
    rng = np.random.default_rng(5)
    for begin in range(7_500, 22_500, 3_750):
        length = int(lost * 3_750)
        at = begin + int(rng.integers(0, 3_750 - length))
        sent[at : at + length] = 0.0
    for name, first_s in (("begins whole", 0), ("begins with a loss", 7_500)):
        flight = tmp_path / name
        keeping = recorder(flight)
        for first in range(first_s, len(sent), 3_750):
            put(keeping, sent[first : first + 3_750], first)
        keeping.close()
        formats = [json.loads(path.read_text()) for path in pieces(flight)]
        assert [one["global"]["core:datatype"] for one in formats] == ["ci8"]


def test_a_long_flight_keeps_its_newest_samples_within_the_budget(tmp_path: Path) -> None:
    keeping = recorder(tmp_path / "flight", budget_mb=1.0)
    sent = noise(1_200_000)  # 2.4 MB
    for at in range(0, len(sent), 120_000):
        store(keeping, sent[at : at + 120_000], at)
    keeping.close()
    kept = [read(path) for path in pieces(tmp_path / "flight")]
    stored = sum(len(one) for one in kept)
    assert stored * 2 <= 1e6
    assert keeping.removed_pieces > 0
    assert keeping.dropped_samples == 0
    newest = np.concatenate(kept)
    assert np.abs(newest - sent[-stored:]).max() < 3e-5


def test_a_stuck_disk_never_holds_up_the_caller_and_costs_counted_samples(
    tmp_path: Path,
) -> None:
    directory = FlightLayout(tmp_path / "flight").channels_directory
    directory.mkdir(parents=True)
    stuck = directory / "channel_148124375_Hz_0001.sigmf-meta"
    os.mkfifo(stuck)  # whoever writes to it waits until somebody reads
    keeping = recorder(tmp_path / "flight")
    sent = 0
    large = noise(100_000)
    for _ in range(30):  # 24 MB
        some = made.channel_block(
            large,
            sent,
            RATE_HZ,
            channel=3,
            center_frequency_hz=CENTER_HZ,
            time_ns=START_NS + round(sent / RATE_HZ * 1e9),
        )
        keeping.put([some])
        sent += len(large)
    assert 6e5 < keeping.dropped_samples < 15e5
    assert keeping.trouble == "the disk is slow"
    while keeping.trouble is not None:  # it comes back
        reader = os.open(stuck, os.O_RDONLY | os.O_NONBLOCK)
        time.sleep(0.05)
        os.close(reader)
    keeping.close()
    assert keeping.written_samples + keeping.dropped_samples == sent


def keep_and_wait(flight: Path) -> None:
    keeping = recorder(flight)
    store(keeping, noise(30_000))
    for some in blocks(noise(3_000), first=30_000):
        keeping.put([some])
    (flight / "written").touch()
    time.sleep(60.0)


def test_what_was_written_before_a_kill_can_be_read(tmp_path: Path) -> None:
    child = forked(keep_and_wait, tmp_path / "flight")
    until((tmp_path / "flight/written").exists)
    child.kill()
    child.join()
    (path,) = pieces(tmp_path / "flight")
    sigmf.fromfile(str(path)).validate()
    assert len(read(path)) >= 30_000
    # A restarted receiver goes on beside it.
    keep(tmp_path / "flight", blocks(noise(3_000), first=0))
    assert [one.stem[-4:] for one in pieces(tmp_path / "flight")] == ["0001", "0002"]


def test_long_samples_are_cut_into_pieces_that_follow_each_other(tmp_path: Path) -> None:
    keeping = recorder(tmp_path / "flight", budget_mb=2.0)  # pieces of 16.7 s
    for at in range(0, 300_000, 50_000):
        store(keeping, noise(50_000, seed=at), at)
    keeping.close()
    ends = []
    for path in pieces(tmp_path / "flight"):
        with closing(open_recording(path)) as source:
            assert source.total_samples is not None
            lasts_ns = source.total_samples / RATE_HZ * 1e9
            ends.append((source.start_time_ns, source.start_time_ns + lasts_ns))
    assert len(ends) >= 3
    for (_, end_ns), (start_ns, _) in pairwise(ends):
        assert abs(start_ns - end_ns) < 2_000
