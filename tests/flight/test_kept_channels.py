"""Two tags too weak for any group of pulses, found in flight and afterwards by what is kept."""

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
import sigmf
from command_line import started

from uavrt.config.settings import IntegrationSettings
from uavrt.flight.integrated import read_integrated
from uavrt.flight.reading.flight_reader import read_flight, read_health
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.scenario import Radio, Scenario, SimulatedTag
from uavrt.simulation.scene.world import World

RATE_HZ = 375_000.0
"""Rate of the band to which 3 MS/s are decimated: the same channels, an eighth of the work."""
CHANNEL_RATE_HZ = 7500.0
LEVEL_DB = 5.5
"""Of a pulse on boresight: half of the groups of three need 9.7 dB while turning.

At 7 dB some groups are confirmed within two minutes, and a tag that has three is not told of.
"""
INTERVAL_S = 0.6
KEPT_S = 75.0
FLIGHT_S = 260.0
"""A busy machine has told of both tags after 160 s, a quiet one after 60 s."""
TURN_DEG_PER_S = 10.0


def weak_tag(tag_id: int, frequency_hz: float, first_pulse_s: float) -> SimulatedTag:
    return made.simulated_tag(
        tag_id,
        frequency_hz,
        INTERVAL_S,
        interval_uncertainty_s=0.01,
        interval_jitter_s=0.004,
        interval_error_s=0.003,
        false_alarm_probability=0.005,
        north_m=400.0,
        east_m=300.0,
        first_pulse_s=first_pulse_s,
        frequency_offset_hz=60.0,
    )


def weak_scenario() -> Scenario:
    """A drone turns on the spot, and each tag has just the wanted level at its best."""
    scenario = Scenario(
        duration_s=FLIGHT_S,
        radio=Radio(center_frequency_hz=148_705_000.0, sample_rate_hz=RATE_HZ),
        tag=(weak_tag(2, 148_710_000.0, 0.5), weak_tag(3, 148_728_000.0, 0.8)),
        flight=Flight(
            height_m=40.0,
            leg=(
                Leg(duration_s=2.0),
                Leg(duration_s=FLIGHT_S - 4.0, turn_deg=TURN_DEG_PER_S * (FLIGHT_S - 4.0)),
            ),
        ),
    )
    start_ns = scenario.start_time_ns
    truth = World(scenario).truth(start_ns, start_ns + 60_000_000_000)
    best_db = max(pulse.enr_db for pulse in truth)
    weaker_db = LEVEL_DB - best_db
    return replace(
        scenario,
        tag=tuple(replace(tag, erp_dbm=tag.erp_dbm + weaker_db) for tag in scenario.tag),
    )


def stored_samples(metadata: Path) -> float:
    """Samples in a piece, by the bytes that it takes."""
    datatype = json.loads(metadata.read_text())["global"]["core:datatype"]
    size = metadata.with_suffix(".sigmf-data").stat().st_size
    return size / {"ci8": 2, "ci16_le": 4}[datatype]


def slowness_of_the_radio(counters: dict[str, float]) -> float:
    """Stream time over what its samples take at the nominal rate; a busy machine is slower."""
    took_s = (counters["last_sample_ns"] - counters["first_sample_ns"]) * 1e-9
    return took_s * RATE_HZ / (counters["samples"] + counters["samples_lost"])


@pytest.mark.slow
@pytest.mark.timeout(480)
def test_weak_tags_are_told_in_flight_and_found_from_the_channels_that_the_drone_kept(
    drone_bay: Any, tmp_path: Path
) -> None:
    scenario = weak_scenario()
    flights = tmp_path / "drone1" / "flights"
    drone = drone_bay.launch(
        scenario,
        tags=scenario.tags,
        integration=IntegrationSettings(on_drone=True),
    )
    kept_s = 0.0
    counters: dict[str, float] = {}
    told: dict[str, str] = {}
    deadline_s = time.monotonic() + FLIGHT_S - 10.0
    while (kept_s < KEPT_S or len(told) < 2) and time.monotonic() < deadline_s:
        for topic, record in drone.status.read(0.5):
            if topic == "status_text" and "found over the flight so far" in record.text:
                told.setdefault(record.text.split()[1], record.text)
            if topic == "system_status":
                for process in record.processes:
                    if process.process == "receiver":
                        counters = process.counters
                kept_s = counters.get("kept_samples", 0.0) / 2 / CHANNEL_RATE_HZ
    drone.end()
    assert set(told) == {"2", "3"}, counters
    (directory,) = flights.glob("flight_log_*")
    pieces = sorted((directory / "iq" / "channels").glob("*.sigmf-meta"))
    assert len({piece.name[:20] for piece in pieces}) == 2
    for piece in pieces:
        sigmf.fromfile(str(piece)).validate()
    assert counters["kept_samples_dropped"] == 0
    (*_, last) = [one for one in read_health(directory) if one.process == "receiver"]
    assert last.counters["kept_samples"] == sum(stored_samples(piece) for piece in pieces)

    verdicts, pulses = read_integrated(directory)
    assert {one.tag_id for one in verdicts if one.found} == {2, 3}
    assert {one.pulse.detection_status for one in pulses} == {"integrated"}
    groups = [one.pulse.confirmed for one in read_flight(directory).pulse_poses]
    sent = 2 * last.counters["kept_samples"] / 2 / CHANNEL_RATE_HZ / INTERVAL_S
    assert sum(groups) < 0.1 * sent  # what the detectors made of it: next to nothing
    said = started("integrate", directory, "--json", check=True, timeout=200)
    found = json.loads(said.stdout)
    assert [(one["tag_id"], one["found"]) for one in found] == [(2, True), (3, True)]
    slower = slowness_of_the_radio(last.counters)
    for one, tag in zip(found, scenario.tag, strict=True):
        known = {name: one[name] for name in ("score", "pulses", "drift")} | dict(last.counters)
        # A late first reading of the clock makes the whole stream look short, which the times
        # of the pieces after it do not share.
        lowest_s, highest_s = ((INTERVAL_S + 0.003) * f(slower, 1.0) for f in (min, max))
        assert lowest_s - 5e-4 < one["interval_s"] < highest_s + 5e-4, known
        assert one["frequency_hz"] == pytest.approx(tag.frequency_hz + 60.0, abs=30.0)
