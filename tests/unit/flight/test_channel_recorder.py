"""Kept channels: what was received can be judged again; a slow disk costs them alone."""

import json
import os
import shutil
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import sigmf
from numpy.typing import NDArray

from uavrt.core.clock import parse_iso_utc
from uavrt.core.messages import ChannelBlock
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.samples.channel_recorder import ChannelRecorder
from uavrt.radio.opening import open_recording

RATE_HZ = 3750.0
CENTER_HZ = 148_124_375.0
START_NS = 1_700_205_419_230_494_976
BLOCK = 328


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


def recorded(flight: Path, *channels: list[ChannelBlock], **limits: float) -> ChannelRecorder:
    keeping = recorder(flight, **limits)
    for some in zip(*channels, strict=True):
        keeping.put(list(some))
    keeping.close()
    return keeping


def keep(flight: Path, *channels: list[ChannelBlock], budget_mb: float = 100.0) -> list[Path]:
    """Keep everything; the files."""
    keeping = recorded(flight, *channels, budget_mb=budget_mb)
    assert keeping.trouble is None
    assert keeping.dropped_samples == 0
    return pieces(flight)


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
    kept = keep(tmp_path / "flight", blocks(one), blocks(other, channel=4))
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


def test_rounding_costs_less_than_a_twentieth_of_a_decibel(tmp_path: Path) -> None:
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
            kept = keep(tmp_path / f"{number}_{level}", blocks(sent))
            back = np.concatenate([read(path) for path in kept])
            added = float(np.mean(np.abs(back - sent) ** 2) / np.mean(np.abs(quiet) ** 2))
            assert 10.0 * np.log10(1.0 + added) < 0.05


def test_lost_samples_and_a_moved_clock_begin_stretches_of_their_own(tmp_path: Path) -> None:
    samples = noise(20 * BLOCK)
    samples[4_000:4_500] = 0.0  # what stands in place of lost samples
    samples[5_000:5_020] = 0.0  # too short to be worth a stretch
    (path,) = keep(
        tmp_path / "flight",
        [
            *blocks(samples),
            *blocks(noise(BLOCK), first=30 * BLOCK),
            *blocks(noise(BLOCK), first=31 * BLOCK, late_ns=2_000_000),
        ],
    )
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
    last, more = (tmp_path / f"flight_log_2026-05-0{day}" for day in (4, 5))
    recorded(last, blocks(noise(150_000, seed=9)), budget_mb=1.0)
    # The first is starred and not counted, the second is the oldest of the others.
    assert [len(pieces(one)) for one in [*flights, last]] == [1, 1, 1, 1]
    keeping = recorded(more, blocks(noise(150_000, seed=10)), budget_mb=1.0)
    assert [len(pieces(one)) for one in [*flights, last, more]] == [1, 0, 1, 1, 1]
    assert keeping.removed_pieces == 1
    assert keeping.kept_mb <= 1.0
    assert not list(FlightLayout(flights[1]).channels_directory.iterdir())


def test_below_the_free_space_limit_nothing_is_kept_and_all_is_counted(tmp_path: Path) -> None:
    free_mb = shutil.disk_usage(tmp_path).free / 1e6
    # Others may still record.
    keeping = recorded(tmp_path / "flight", blocks(noise(10 * BLOCK)), free_mb=free_mb)
    assert keeping.dropped_samples == 10 * BLOCK
    assert keeping.written_samples == 0
    assert keeping.trouble == "the disk is nearly full"
    assert not pieces(tmp_path / "flight")


def test_values_that_are_no_numbers_are_zeros_and_counted(tmp_path: Path) -> None:
    samples = noise(BLOCK)
    samples[7] = np.nan + 1j
    keeping = recorded(tmp_path / "flight", blocks(samples))
    assert keeping.invalid_values == 1
    (path,) = pieces(tmp_path / "flight")
    assert read(path)[7] == 0.0
