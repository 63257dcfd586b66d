"""A weak tag is found from the channels that the flight kept: pieces joined, gaps respected."""

import math
import re
import shutil
from collections.abc import Sequence
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path

import made
import numpy as np
import pytest
from command_line import Ran
from numpy.typing import NDArray
from sql import sql
from tests.unit.whole_flight.conftest import RATE_HZ, WINDOW_HZ, Rotation

from uavrt.analysis.coverage_files import write_silence
from uavrt.analysis.report.report_words import hindsight
from uavrt.analysis.survey import read_survey
from uavrt.analysis.whole_flights.judged_flights import IntegratedTag, WholeFlightOptions
from uavrt.analysis.whole_flights.kept_samples import channel_of, integrate_kept, kept_channels
from uavrt.config.settings import Settings
from uavrt.core.errors import FormatError, UavrtError
from uavrt.core.messages import ChannelBlock, Tag
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.flight.samples.channel_recorder import ChannelRecorder
from uavrt.localization.antenna import PATTERNS
from uavrt.radio.files.joined import JoinedRecording
from uavrt_experiments.detection.signals import START_NS, noise

WINDOW = ("--frequency-window", WINDOW_HZ)
SPACING_HZ = 1875.0
GAP_S = (70.0, 75.0)


def one_second(
    samples: NDArray[np.complex64], channel: int, at_s: int, hz: float
) -> ChannelBlock:
    rate = round(RATE_HZ)
    return made.channel_block(
        samples[at_s * rate : (at_s + 1) * rate],
        at_s * rate,
        RATE_HZ,
        time_ns=START_NS + at_s * 1_000_000_000,
        channel=channel,
        center_frequency_hz=hz + channel * SPACING_HZ,
    )


def closed(keeping: ChannelRecorder) -> None:
    """Write what waits; nothing of it is lost."""
    keeping.close(timeout_s=600.0)
    assert keeping.dropped_samples == 0


@pytest.fixture(scope="module")
def kept(weak: Rotation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight that kept the channel of a weak tag, and one with nothing but noise."""
    directory = tmp_path_factory.mktemp("kept") / "flight_log_2023-11-14_22-13-20"
    other = replace(weak.tag, tag_id=9, frequency_hz=weak.tag.frequency_hz + 4 * SPACING_HZ)
    info = replace(weak.flight.info, directory=str(directory), tags=(weak.tag, other))
    listened = replace(Settings().detection, frequency_window_hz=WINDOW_HZ)
    made.flight(info, replace(Settings(), detection=listened), poses=weak.flight.poses)
    quiet = noise(np.random.default_rng(4), len(weak.samples))
    with pytest.MonkeyPatch.context() as patched:
        # A disk that other tests keep busy would be left alone for 10 s, and samples dropped.
        patched.setattr("uavrt.flight.samples.channel_recorder.SLOW_S", math.inf)
        keeping = ChannelRecorder(directory, budget_mb=12.0, minimum_free_mb=0.0)
        for at_s in range(int(len(quiet) / RATE_HZ)):
            if GAP_S[0] <= at_s < GAP_S[1]:
                continue
            both = [(weak.samples, 0), (quiet, 4)]
            blocks = [one_second(some, n, at_s, weak.tag.frequency_hz) for some, n in both]
            keeping.put(blocks)
            if at_s % 60 == 59:  # the receiver starts again: the next piece
                closed(keeping)
                keeping = ChannelRecorder(directory, budget_mb=12.0, minimum_free_mb=0.0)
        closed(keeping)
    return directory


@pytest.fixture
def flown(kept: Path, tmp_path: Path) -> Path:
    """The same for a test alone."""
    return Path(shutil.copytree(kept, tmp_path / kept.name))


def judged(flight: Path, tags: Sequence[Tag]) -> list[IntegratedTag]:
    how = WholeFlightOptions(pattern=PATTERNS["RA-23K"], frequency_window_hz=WINDOW_HZ)
    return integrate_kept(read_flight(flight), tags, how)


def test_each_tag_is_judged_from_the_pieces_of_its_own_channel(
    flown: Path, weak: Rotation
) -> None:
    channels = kept_channels(flown)
    beside_hz = [one.center_frequency_hz - weak.tag.frequency_hz for one in channels]
    assert [*map(round, beside_hz)] == [0, 7500]
    assert all(len(one.paths) >= 3 for one in channels)
    found = judged(flown, read_flight(flown).info.tags)
    assert [one.found for one in found] == [True, False]
    assert [one.tag.tag_id for one in found] == [weak.tag.tag_id, 9]
    assert found[0].pulses.interval_s == pytest.approx(weak.interval_s, abs=2e-4)
    # Nothing is said of the time without samples.
    times_s = (found[0].pulse_times_ns - START_NS) * 1e-9
    inside = (times_s > GAP_S[0] + 0.1) & (times_s < GAP_S[1] - 0.1)
    assert not inside.any()
    assert (times_s > GAP_S[1]).sum() > 80


def test_the_command_takes_what_the_flight_kept_by_itself(flown: Path, ran: Ran) -> None:
    damaged = FlightLayout(flown).channels_directory / "channel_1_Hz_0001.sigmf-meta"
    damaged.write_text("{")
    told = ran("integrate", flown, *WINDOW, "--json").json
    assert [one["found"] for one in told] == [True, False]
    # Whose samples it held nobody knows.
    for one in told:
        limits = str(one["limitations"])
        assert "channel_1_Hz_0001.sigmf-meta" in limits
        assert "is damaged, or not a SigMF file" in limits


def test_a_flight_without_tags_is_told_what_it_lacks(flown: Path, ran: Ran) -> None:
    """It ended with 1 and said nothing, as if tags had been looked for in vain."""
    sql(flown, "DELETE FROM tags")
    assert "there are no tags to search for" in ran("integrate", flown, ends=2).words


def test_what_kept_channels_tell_themselves_is_refused(flown: Path, ran: Ran) -> None:
    said = ran("integrate", flown, "--sample-rate", 48000, ends=2).words
    assert "--sample-rate applies only to --recording" in said
    assert "Leave --sample-rate out" in said


def test_a_tag_that_is_not_found_has_the_map_of_where_it_is_not(flown: Path, ran: Ran) -> None:
    """It took a second command to learn what the silence of a whole flight says."""
    power = ("--tag", 9, "--tag-power", -50, "--json")
    (said,) = ran("integrate", flown, *WINDOW, *power, ends=1).json
    silence = said["silence"]
    assert silence["whole_flight"]
    # The same map as of the command that makes nothing else.
    (mapped,) = ran("coverage", flown, "-o", flown / "maps", *power).json
    shared = ("mean_probability", "share50", "share90", "sure_within_m", "antenna")
    assert {name: silence[name] for name in shared} == {name: mapped[name] for name in shared}
    assert 500.0 < silence["sure_within_m"] < 2000.0
    assert 0.1 < silence["share90"] < 0.9
    names = ["coverage_tag_9.tif", "coverage_tag_9.png"]
    for file, name in zip(silence["files"], names, strict=True):
        assert Path(file) == flown / "integrated" / name
        assert Path(file).read_bytes() == (flown / "maps" / name).read_bytes()
    # It is told with the verdict, in words.
    _, words = dict(hindsight(read_survey(flown), 9).rows)["Whole flight"]
    assert silence["sure_within_m"] - 10.0 < float(words.split()[1]) <= silence["sure_within_m"]
    assert "\N{MINUS SIGN}50 dBm would have been found with a probability of at least" in words
    weakest = ("--tag", 9, "--tag-power", -90, "--no-save")
    assert (
        "nowhere around the flight" in ran("integrate", flown, *WINDOW, *weakest, ends=1).words
    )


def test_a_map_of_where_a_tag_is_not_goes_when_it_is_found(flown: Path) -> None:
    integrated = flown / "integrated"
    integrated.mkdir()
    for tag_id in (2, 9):
        for ending in ("tif", "png"):
            (integrated / f"coverage_tag_{tag_id}.{ending}").write_bytes(b"")
    write_silence(integrated, read_flight(flown), {}, [2])
    assert {one.stem for one in integrated.iterdir()} == {"coverage_tag_9"}
    assert len([*integrated.iterdir()]) == 2


def test_a_tag_whose_channel_was_not_kept_is_named(flown: Path, weak: Rotation) -> None:
    alien = replace(weak.tag, tag_id=5, frequency_hz=weak.tag.frequency_hz + 50_000.0)
    with pytest.raises(UavrtError, match=r"has no samples of tag 5 at 1\d\d\.\d+ MHz"):
        judged(flown, [weak.tag, alien])


def test_a_tag_between_two_channels_has_the_nearer_one(flown: Path, weak: Rotation) -> None:
    channels = kept_channels(flown)

    def found(offset_hz: float) -> float | None:
        tag: Tag = replace(weak.tag, frequency_hz=weak.tag.frequency_hz + offset_hz)
        channel = channel_of(channels, tag)
        return None if channel is None else channel.center_frequency_hz - weak.tag.frequency_hz

    assert [found(offset) for offset in (900.0, 3_700.0, 6_600.0)] == [0.0, None, 7_500.0]


def test_a_tag_whose_only_piece_is_damaged_is_told_of_the_damage(
    flown: Path, weak: Rotation
) -> None:
    for path in FlightLayout(flown).channels_directory.glob("*.sigmf-meta"):
        path.write_text("{")
    said = r"has no samples of tag .* was left out: .*not a SigMF"
    with pytest.raises(UavrtError, match=said):
        judged(flown, [weak.tag])


def test_what_is_damaged_is_told_when_the_rest_is_too_little(
    flown: Path, weak: Rotation
) -> None:
    first, _ = kept_channels(flown)
    for path in first.paths[1:]:
        path.write_text("{")
    data = first.paths[0].with_suffix(".sigmf-data")
    with data.open("r+b") as file:
        file.truncate(4 * 3750)
    with pytest.raises(UavrtError, match=r"was left out: .*not a SigMF"):
        judged(flown, [weak.tag])


def test_pieces_become_one_stream_whose_indices_count_what_is_missing(flown: Path) -> None:
    (first, _) = kept_channels(flown)
    with closing(JoinedRecording(tuple(reversed(first.paths)))) as source:
        index = lost = samples = 0
        end_ns = source.start_time_ns
        with suppress(EOFError):
            while (block := source.read()) is not None:
                assert block.sample_index == index + block.lost_before
                gap_ns = block.lost_before / RATE_HZ * 1e9
                assert abs(block.time_ns - end_ns - gap_ns) < 3_000
                index = block.sample_index + len(block.samples)
                end_ns = block.time_ns + round(len(block.samples) / RATE_HZ * 1e9)
                lost += block.lost_before
                samples += len(block.samples)
    assert lost == pytest.approx((GAP_S[1] - GAP_S[0]) * RATE_HZ, abs=1)
    assert samples == source.total_samples == first.samples


def test_pieces_of_different_channels_are_not_joined(flown: Path) -> None:
    first, second = kept_channels(flown)
    with pytest.raises(FormatError, match="differ in sample rate"):
        JoinedRecording((first.paths[0], second.paths[0]))


def test_a_piece_that_is_cut_off_is_used_as_far_as_it_goes(flown: Path) -> None:
    (first, _) = kept_channels(flown)
    data = first.paths[1].with_suffix(".sigmf-data")
    size = data.stat().st_size
    with data.open("r+b") as file:
        file.truncate(size // 4 * 2 + 1)
    with closing(JoinedRecording(first.paths)) as source:
        samples = 0
        with suppress(EOFError):
            while (block := source.read()) is not None:
                samples += len(block.samples)
        assert len(source.left_out) == 1
    assert samples == pytest.approx(first.samples - size / 4, abs=2)


def test_a_place_for_pictures_that_cannot_be_made_is_refused_before_the_search(
    flown: Path, ran: Ran
) -> None:
    """It was found out after minutes of work, and what had been found was not told."""
    plot = ("--tag", 2, "--plot", flown / "flight.sqlite" / "x")
    said = ran("integrate", flown, *plot, ends=2).words
    assert re.search("cannot be made.*--plot", said)
    assert not (flown / "integrated").exists()
