"""A flight judged while it goes on: the same energies as afterwards, and a tag that is told."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import made
import numpy as np
import pytest
from some import some
from tests.unit.whole_flight.conftest import RATE_HZ, WINDOW_HZ, Rotation

from uavrt.analysis.integrated.flight_so_far import FlightSoFar, found_in_flight
from uavrt.analysis.integrated.integrator import (
    SHARE,
    FindReporter,
    Integration,
    SearchSchedule,
)
from uavrt.analysis.whole_flights.judged_flights import WholeFlightOptions
from uavrt.config.settings import IntegrationSettings, RecordingSettings, Settings
from uavrt.core.messages import WHOLE_FLIGHT_FALSE_ALARM, Tag
from uavrt.drone.supervisor.tree.process_shapes import rows_for
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.samples.channel_recorder import ChannelRecorder
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.whole_flight.energies.energy_grid import slot_energies
from uavrt.localization.whole_flight.energies.growing import GrowingEnergies
from uavrt.localization.whole_flight.tuning import ENERGY
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG


def growing(weak: Rotation) -> GrowingEnergies:
    return GrowingEnergies(
        weak.tag,
        start_ns=START_NS,
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=weak.tag.frequency_hz,
        frequency_window_hz=WINDOW_HZ,
    )


def test_energies_that_grow_are_those_of_the_whole_recording(weak: Rotation) -> None:
    samples, there = weak.samples, np.ones(len(weak.samples), np.bool_)
    there[200_000:215_000] = False
    samples = np.where(there, samples, np.complex64(0.0))
    whole = slot_energies(
        samples,
        there,
        tag=weak.tag,
        start_ns=START_NS,
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=weak.tag.frequency_hz,
        frequency_window_hz=WINDOW_HZ,
    )
    some = growing(weak)
    rng = np.random.default_rng(1)
    until = 0
    while until < len(samples):
        until = min(len(samples), until + int(rng.integers(20_000, 200_000)))
        begin = round((some.needed_from_ns - START_NS) * 1e-9 * RATE_HZ)
        begin_ns = START_NS + round(begin / RATE_HZ * 1e9)
        some.take(samples[begin:until], there[begin:until], begin_ns)
    grown = some.energies()
    slots = len(grown.heard)
    assert slots * grown.slot_s == pytest.approx(some.length_s)
    assert some.length_s > len(samples) / RATE_HZ - ENERGY.block_s - 1.0
    assert grown.start_ns == whole.start_ns
    assert np.mean(grown.heard != whole.heard[:slots]) < 0.002
    both = grown.heard & whole.heard[:slots]
    assert (
        np.corrcoef(grown.energy[:, both].ravel(), whole.energy[:, :slots][:, both].ravel())[
            0, 1
        ]
        > 0.99
    )
    assert grown.energy[:, both].std() == pytest.approx(1.0, abs=0.02)


def keep(
    directory: Path, weak: Rotation, from_s: int, until_s: int, recorder: ChannelRecorder
) -> None:
    """Keep a stretch of two channels: the tag's, and one of noise."""
    rng, rate = np.random.default_rng(from_s), round(RATE_HZ)
    for at_s in range(from_s, until_s):
        samples = weak.samples[at_s * rate : (at_s + 1) * rate]
        quiet = rng.standard_normal((len(samples), 2)).astype(np.float32).view(np.complex64)
        recorder.put(
            [
                made.channel_block(
                    block,
                    at_s * rate,
                    RATE_HZ,
                    time_ns=START_NS + at_s * 1_000_000_000,
                    channel=number,
                    center_frequency_hz=weak.tag.frequency_hz + 1875.0 * number,
                )
                for number, block in ((0, samples), (4, quiet[:, 0]))
            ]
        )


def test_a_tag_below_the_noise_is_found_before_the_flight_has_ended(
    weak: Rotation, tmp_path: Path
) -> None:
    directory = tmp_path / "flight_log_2023-11-14_22-13-20"
    other = replace(weak.tag, tag_id=9, frequency_hz=weak.tag.frequency_hz + 4 * 1875.0)
    info = replace(weak.flight.info, directory=str(directory), tags=(weak.tag, other))
    log = FlightRecorder.create(info, None)
    flight = FlightSoFar(
        directory, WholeFlightOptions(pattern=PATTERNS["RA-23K"], frequency_window_hz=WINDOW_HZ)
    )
    assert flight.search(weak.tag) is None  # nothing is kept yet
    found = {}
    until_s = int(len(weak.samples) / RATE_HZ)
    for from_s in range(0, until_s, 100):
        recorder = ChannelRecorder(directory, budget_mb=100.0, minimum_free_mb=0.0)
        end_s = min(from_s + 100, until_s)
        keep(directory, weak, from_s, end_s, recorder)
        recorder.close()
        end_ns = START_NS + end_s * 1_000_000_000
        new = [p for p in weak.flight.poses if from_s * 10**9 <= p.time_ns - START_NS]
        log.write(*(p for p in new if p.time_ns < end_ns))
        log.commit()
        for tag in (weak.tag, other):
            result = some(flight.search(tag))
            found[tag.tag_id] = result
            assert flight.search(tag) is None  # nothing new since
    log.close()
    mine = found[weak.tag.tag_id]
    assert mine.found
    assert mine.train.false_alarm_probability < WHOLE_FLIGHT_FALSE_ALARM / 6
    assert mine.pulses.interval_s == pytest.approx(weak.interval_s, abs=2e-4)
    miss_deg = (some(mine.place).bearing_deg - weak.bearing_deg + 180.0) % 360.0 - 180.0
    assert abs(miss_deg) < 15.0
    assert not found[9].found
    text = found_in_flight(mine)
    assert text.startswith(
        f"Tag {weak.tag.tag_id} found over the flight so far, direction from the middle "
    )
    assert len(text) <= 200


def tags(count: int) -> list[Tag]:
    return [replace(THESIS_TAG, tag_id=2 + number) for number in range(count)]


def test_looks_take_turns_and_a_tenth_of_a_core() -> None:
    schedule, now_s, worked_s = SearchSchedule(tags(3)), 0.0, 0.0
    seen: list[int] = []
    while now_s < 3000.0:
        tag = schedule.due(now_s)
        if tag is None:
            now_s += 0.5
            continue
        seen.append(tag.tag_id)
        cost_s = 8.0
        now_s, worked_s = now_s + cost_s, worked_s + cost_s
        schedule.searched(tag, now_s, cost_s, new=True)
        assert schedule.due(now_s + SHARE * cost_s - 0.1) is None
    assert {seen.count(tag) for tag in (2, 3, 4)} <= {len(seen) // 3, len(seen) // 3 + 1}
    assert worked_s < 0.105 * now_s


def test_only_what_no_detector_found_is_told_and_again_when_it_is_much_closer(
    weak: Rotation, tmp_path: Path
) -> None:
    directory = tmp_path / "flight"
    info = replace(weak.flight.info, directory=str(directory))
    made.flight(info, poses=weak.flight.poses)
    recorder = ChannelRecorder(directory, budget_mb=100.0, minimum_free_mb=0.0)
    keep(directory, weak, 0, int(len(weak.samples) / RATE_HZ), recorder)
    recorder.close()
    flight = FlightSoFar(
        directory, WholeFlightOptions(pattern=PATTERNS["RA-23K"], frequency_window_hz=WINDOW_HZ)
    )
    result = some(flight.search(weak.tag))
    assert result.place is not None
    reporter = FindReporter()
    assert reporter.text(replace(result, heard_alone=20)) is None
    assert reporter.text(result) is not None
    assert reporter.text(result) is None
    closer = replace(result.place, radius95_m=0.4 * result.place.radius95_m)
    assert reporter.text(replace(result, place=closer)) is not None


def test_the_integrator_is_a_row_for_who_keeps_channels_and_wants_it() -> None:
    def added(settings: Settings) -> set[str]:
        return {row.name for row in set(rows_for(settings)) - set(rows_for(Settings()))}

    wanted = IntegrationSettings(on_drone=True)
    assert added(Settings(integration=wanted)) == {"integrator"}
    spared = RecordingSettings(channels=False)
    assert added(Settings(integration=wanted, recording=spared)) == set()


def test_a_fault_at_one_look_is_told_and_ends_no_other(tmp_path: Path) -> None:
    class Faulty:
        def search(self, tag: Tag) -> None:
            if tag.tag_id == 2:
                raise ValueError("not foreseen")

    assignment = SimpleNamespace(settings=Settings(), flight=None)
    integration = Integration(SimpleNamespace(assignment=assignment))  # type: ignore[arg-type]
    told = []
    for tag in tags(2):
        integration._jobs.put((Faulty(), tmp_path, tag))  # type: ignore[arg-type]
        _, judged, result, _ = integration._done.get(timeout=10.0)
        told.append((judged.tag_id, result, integration.fault))
    integration._jobs.put(None)
    assert told == [(2, None, "tag 2 cannot be searched: not foreseen"), (3, None, None)]
