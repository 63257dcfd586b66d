"""Kept channels: what was received can be judged again; a slow disk costs them alone."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import closing, suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sigmf
from numpy.typing import NDArray

from uavrt.clock import parse_iso_utc
from uavrt.messages import ChannelBlock
from uavrt.radio import open_recording
from uavrt.recording import ChannelRecorder, FlightLayout, channel_recorder

RATE_HZ = 3750.0
CENTER_HZ = 148_124_375.0
START_NS = 1_700_205_419_230_494_976
BLOCK = 328


@pytest.fixture(autouse=True)
def soon_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let samples wait for 0.1 s in place of 2: many tests wait until they are on the disk."""
    monkeypatch.setattr(channel_recorder, "FLUSH_S", 0.1)


def noise(count: int, level: float = 1e-4, seed: int = 1) -> NDArray[np.complex64]:
    """Noise with this rms of I and of Q."""
    numbers = np.random.default_rng(seed).standard_normal(2 * count) * level
    return numbers.astype(np.float32).view(np.complex64)


def blocks(
    samples: NDArray[np.complex64], *, first: int = 0, channel: int = 3, late_ns: int = 0
) -> list[ChannelBlock]:
    """A channel's samples as radio blocks bring them."""
    return [
        ChannelBlock(
            channel=channel,
            center_frequency_hz=CENTER_HZ + 1875.0 * (channel - 3),
            samples=samples[at : at + BLOCK],
            sample_index=first + at,
            time_ns=START_NS + late_ns + round((first + at) / RATE_HZ * 1e9),
            sample_rate_hz=RATE_HZ,
        )
        for at in range(0, len(samples), BLOCK)
    ]


def recorder(flight: Path, budget_mb: float = 100.0, free_mb: float = 0.0) -> ChannelRecorder:
    flight.mkdir(parents=True, exist_ok=True)
    return ChannelRecorder(flight, budget_mb=budget_mb, minimum_free_mb=free_mb)


def keep(flight: Path, *channels: list[ChannelBlock], budget_mb: float = 100.0) -> None:
    keeping = recorder(flight, budget_mb)
    for some in zip(*channels, strict=True):
        keeping.put(list(some))
    keeping.close()
    assert keeping.trouble is None
    assert keeping.dropped_samples == 0


def pieces(flight: Path) -> list[Path]:
    return sorted(FlightLayout(flight).channels_directory.glob("*.sigmf-meta"))


def read(path: Path) -> NDArray[np.complex64]:
    parts = []
    with closing(open_recording(path)) as source, suppress(EOFError):
        while (block := source.read()) is not None:
            parts.append(block.samples.copy())
    return np.concatenate(parts)


def test_each_channel_is_valid_sigmf_that_reads_back_as_it_was(tmp_path: Path) -> None:
    one, other = noise(30_000), noise(30_000, 3e-3, seed=2)
    keep(tmp_path / "flight", blocks(one), blocks(other, channel=4))
    kept = pieces(tmp_path / "flight")
    assert [path.name for path in kept] == [
        "channel_148124375_Hz_0001.sigmf-meta",
        "channel_148126250_Hz_0001.sigmf-meta",
    ]
    for path, sent in zip(kept, (one, other), strict=True):
        sigmf.fromfile(str(path)).validate()
        about = json.loads(path.read_text())
        assert about["captures"][0]["core:datetime"] == "2023-11-17T07:16:59.230494976Z"
        with closing(open_recording(path)) as source:
            assert (source.sample_rate_hz, source.total_samples) == (RATE_HZ, 30_000)
            assert source.center_frequency_hz in (CENTER_HZ, CENTER_HZ + 1875.0)
            assert abs(source.start_time_ns - START_NS) < 1_000
        # Steps of a third of the noise at most, of 8 bits: 15 kB a second at 7500 a second.
        assert about["global"]["core:datatype"] == "ci8"
        assert path.with_suffix(".sigmf-data").stat().st_size == 60_000
        assert np.abs((read(path) - sent).real).max() < np.std(sent.real) / 6.0 * 1.001


def test_rounding_costs_less_than_a_twentieth_of_a_decibel_beside_any_signal(
    tmp_path: Path,
) -> None:
    for number, above_db in enumerate((0.0, 40.0, 58.0, 66.0, 73.0)):
        for level in (3e-7, 1.3e-4, 0.02):
            quiet = noise(15_000, level)
            amplitude = level * 10.0 ** (above_db / 20.0)
            tone = amplitude * np.exp(0.3j * np.arange(15_000))
            tone[7_000:] = 0.0
            if number % 2:
                tone *= 0.0
                tone[::5_000] = amplitude  # impulses; otherwise half the time a carrier
            sent = (quiet + tone).astype(np.complex64)
            flight = tmp_path / f"{number}_{level}"
            keep(flight, blocks(sent))
            back = np.concatenate([read(path) for path in pieces(flight)])
            added = float(np.mean(np.abs(back - sent) ** 2) / np.mean(np.abs(quiet) ** 2))
            assert 10.0 * np.log10(1.0 + added) < 0.05


def test_a_signal_that_grows_is_never_clipped(tmp_path: Path) -> None:
    grows = noise(60_000) + np.geomspace(1e-4, 1.0, 60_000).astype(np.complex64)
    keeping = recorder(tmp_path / "flight")
    for some in blocks(grows[:30_000]):
        keeping.put([some])
    while keeping.written_samples < 30_000:  # the second half meets a file that is open
        time.sleep(0.01)
    for some in blocks(grows[30_000:], first=30_000):
        keeping.put([some])
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
        for some in blocks(sent[part], first=part.start):
            keeping.put([some])
        while keeping.written_samples < part.stop:
            time.sleep(0.01)
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
        for some in blocks(sent[first : first + 7_500], first=first):
            keeping.put([some])
        while keeping.written_samples < first + 7_500:
            time.sleep(0.01)
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
    for some in blocks(sent[:15_000]):
        keeping.put([some])
    while keeping._waiting_bytes:  # the zeros are taken by themselves
        time.sleep(0.01)
    for some in blocks(sent[15_000:], first=15_000):
        keeping.put([some])
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
            for some in blocks(sent[first : first + 3_750], first=first):
                keeping.put([some])
            while keeping._waiting_bytes:
                time.sleep(0.01)
        keeping.close()
        formats = [json.loads(path.read_text()) for path in pieces(flight)]
        assert [one["global"]["core:datatype"] for one in formats] == ["ci8"]


def test_lost_samples_and_a_moved_clock_are_stretches_with_their_own_times(
    tmp_path: Path,
) -> None:
    samples = noise(20 * BLOCK)
    samples[4_000:4_500] = 0.0  # what stands in place of lost samples
    samples[5_000:5_020] = 0.0  # too short to be worth a stretch
    keep(
        tmp_path / "flight",
        [
            *blocks(samples),
            *blocks(noise(BLOCK), first=30 * BLOCK),
            *blocks(noise(BLOCK), first=31 * BLOCK, late_ns=2_000_000),
        ],
    )
    (path,) = pieces(tmp_path / "flight")
    sigmf.fromfile(str(path)).validate()
    about = json.loads(path.read_text())
    starts = [capture["core:global_index"] for capture in about["captures"]]
    assert starts == [0, 4_500, 30 * BLOCK, 31 * BLOCK]
    missing = [note["core:comment"].split()[0] for note in about["annotations"]]
    assert missing == ["500", f"{10 * BLOCK}"]  # where the clock moved none is
    times = [parse_iso_utc(one["core:datetime"][:26] + "Z") for one in about["captures"]]
    seconds = [(time_ns - times[0]) * 1e-9 for time_ns in times]
    assert np.allclose(
        seconds,
        [0.0, 4_500 / RATE_HZ, 30 * BLOCK / RATE_HZ, 31 * BLOCK / RATE_HZ + 0.002],
        rtol=0.0,
        atol=2e-6,
    )


def test_the_oldest_pieces_of_all_flights_go_when_the_budget_is_used(tmp_path: Path) -> None:
    flights = [tmp_path / f"flight_log_2026-05-0{day}" for day in (1, 2, 3)]
    for day, flight in enumerate(flights):
        keep(flight, blocks(noise(150_000, seed=day)), budget_mb=1.0)  # 0.3 MB each
        for path in FlightLayout(flight).channels_directory.iterdir():
            os.utime(path, (1e9 + day, 1e9 + day))
    FlightLayout(flights[0]).star.touch()
    last = tmp_path / "flight_log_2026-05-04"
    keeping = recorder(last, budget_mb=1.0)
    for some in blocks(noise(150_000, seed=9)):
        keeping.put([some])
    keeping.close()
    # The first is starred and not counted, the second is the oldest of the others.
    assert [len(pieces(one)) for one in [*flights, last]] == [1, 1, 1, 1]
    more = tmp_path / "flight_log_2026-05-05"
    keeping = recorder(more, budget_mb=1.0)
    for some in blocks(noise(150_000, seed=10)):
        keeping.put([some])
    keeping.close()
    assert [len(pieces(one)) for one in [*flights, last, more]] == [1, 0, 1, 1, 1]
    assert keeping.removed_pieces == 1
    assert keeping.kept_mb <= 1.0
    assert not list(FlightLayout(flights[1]).channels_directory.iterdir())


def test_a_long_flight_keeps_its_newest_samples_within_the_budget(tmp_path: Path) -> None:
    keeping = recorder(tmp_path / "flight", budget_mb=1.0)
    sent = noise(1_200_000)  # 2.4 MB
    for at in range(0, len(sent), 120_000):
        for some in blocks(sent[at : at + 120_000], first=at):
            keeping.put([some])
        while keeping.written_samples + keeping.dropped_samples < at + 120_000:
            time.sleep(0.01)
    keeping.close()
    kept = [read(path) for path in pieces(tmp_path / "flight")]
    stored = sum(len(one) for one in kept)
    assert stored * 2 <= 1e6
    assert keeping.removed_pieces > 0
    assert keeping.dropped_samples == 0
    newest = np.concatenate(kept)
    assert np.abs(newest - sent[-stored:]).max() < 3e-5


def test_below_the_free_space_limit_nothing_is_kept_and_all_is_counted(tmp_path: Path) -> None:
    free_mb = shutil.disk_usage(tmp_path).free / 1e6
    keeping = recorder(tmp_path / "flight", free_mb=free_mb)  # others may still record
    for some in blocks(noise(10 * BLOCK)):
        keeping.put([some])
    keeping.close()
    assert keeping.dropped_samples == 10 * BLOCK
    assert keeping.written_samples == 0
    assert keeping.trouble == "the disk is nearly full"
    assert not pieces(tmp_path / "flight")


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
    for number in range(30):  # 24 MB
        (some,) = [
            ChannelBlock(
                channel=3,
                center_frequency_hz=CENTER_HZ,
                samples=large,
                sample_index=number * len(large),
                time_ns=START_NS + round(number * len(large) / RATE_HZ * 1e9),
                sample_rate_hz=RATE_HZ,
            )
        ]
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


def test_what_was_written_before_a_kill_can_be_read(tmp_path: Path) -> None:
    program = (
        "import sys, time; sys.path.insert(0, sys.argv[2]); from pathlib import Path\n"
        "from test_channel_recorder import blocks, noise, recorder\n"
        "keeping = recorder(Path(sys.argv[1]))\n"
        "for some in blocks(noise(30_000)): keeping.put([some])\n"
        "while keeping.written_samples < 30_000: time.sleep(0.01)\n"
        "for some in blocks(noise(3_000), first=30_000): keeping.put([some])\n"
        "print('written', flush=True); time.sleep(60)\n"
    )
    here = str(Path(__file__).parent)
    child = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path / "flight"), here],
        stdout=subprocess.PIPE,
    )
    assert child.stdout is not None
    assert child.stdout.readline() == b"written\n"
    child.send_signal(signal.SIGKILL)
    child.wait()
    child.stdout.close()
    (path,) = pieces(tmp_path / "flight")
    sigmf.fromfile(str(path)).validate()
    assert len(read(path)) >= 30_000
    # A restarted receiver goes on beside it.
    keep(tmp_path / "flight", blocks(noise(3_000), first=0))
    assert [one.stem[-4:] for one in pieces(tmp_path / "flight")] == ["0001", "0002"]


def test_values_that_are_no_numbers_are_zeros_and_counted(tmp_path: Path) -> None:
    samples = noise(BLOCK)
    samples[7] = np.nan + 1j
    keeping = recorder(tmp_path / "flight")
    keeping.put(blocks(samples))
    keeping.close()
    assert keeping.invalid_values == 1
    (path,) = pieces(tmp_path / "flight")
    assert read(path)[7] == 0.0


def test_long_samples_are_cut_into_pieces_that_follow_each_other(tmp_path: Path) -> None:
    keeping = recorder(tmp_path / "flight", budget_mb=2.0)  # pieces of 16.7 s
    for at in range(0, 300_000, 50_000):
        for some in blocks(noise(50_000, seed=at), first=at):
            keeping.put([some])
        while keeping.written_samples < at + 50_000:
            time.sleep(0.01)
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
