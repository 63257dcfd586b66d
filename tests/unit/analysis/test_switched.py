"""Bearings from samples that came through an antenna switch, from IQ to the command line."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from command_line import Ran
from gapped import GAP_S, KINDS, write_gapped
from some import some

from uavrt.analysis.measure.switched import (
    SWITCH_KEY,
    read_switched_array,
    switched_bearings,
)
from uavrt.core.errors import FormatError, UsageError
from uavrt.core.messages import PulsePose
from uavrt.core.units import SPEED_OF_LIGHT_M_S
from uavrt.localization.angles import difference_deg
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.antenna_switch import AntennaSwitch
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.scenario import Radio, Scenario
from uavrt.simulation.scene.world import World
from uavrt.simulation.simulated_recording import simulate_to_directory
from uavrt_experiments.localization.array_bars import switched_bound_deg

RATE_HZ = 48_000.0
CIRCLE = AntennaSwitch(kind="circle", elements=4, size_m=0.4)
PAIR = AntennaSwitch(kind="sum_difference", size_m=1.0)
ELEMENTS = AntennaSwitch(kind="pair", size_m=1.0)


def world(
    switch: AntennaSwitch, *, tags: int = 1, duration_s: float = 8.0, turn_deg: float = 0.0
) -> Scenario:
    """Tags all around a drone that stands still, or turns."""
    rng = np.random.default_rng(5)
    bearings = np.radians(rng.uniform(0.0, 360.0, tags))
    return Scenario(
        name="switched",
        seed=3,
        duration_s=duration_s,
        radio=Radio(sample_rate_hz=RATE_HZ, center_frequency_hz=148.7e6),
        antenna=Antenna(pattern="monopole", gain_dbi=2.0, polarization="any", switch=switch),
        tag=tuple(
            made.simulated_tag(
                2 + number,
                148.7e6 + 1500.0 * (number - tags // 2) + 700.0,
                interval_uncertainty_s=0.02,
                north_m=400.0 * math.cos(bearing),
                east_m=400.0 * math.sin(bearing),
                erp_dbm=-48.0 if tags == 1 else -60.0,
                first_pulse_s=0.3 + 0.041 * number,
            )
            for number, bearing in enumerate(bearings)
        ),
        flight=Flight(
            height_m=20.0,
            heading_deg=70.0,
            wobble_deg=0.0,
            leg=(Leg(duration_s=duration_s, turn_deg=turn_deg),),
        ),
    )


def detected(scenario: Scenario, seed: int = 1) -> list[PulsePose]:
    """The true pulses, with a detector's errors of 1 ms and 2.5 Hz."""
    rng = np.random.default_rng(seed)
    end_ns = scenario.start_time_ns + round(scenario.duration_s * 1e9) - 30_000_000
    found = []
    for truth in World(scenario).truth(scenario.start_time_ns, end_ns):
        shift_ns = round(rng.normal(0.0, 0.7e6))
        start_ns = truth.start_time_ns + shift_ns
        pulse = made.pulse(
            start_ns,
            tag_id=truth.tag_id,
            frequency_hz=truth.frequency_hz + float(rng.normal(0.0, 2.5)),
            end_time_ns=truth.end_time_ns + shift_ns,
            snr_db=truth.enr_db,
        )
        found.append(PulsePose(pulse=pulse, pose=scenario.antenna_pose(start_ns)))
    return found


def recorded(scenario: Scenario, directory: Path) -> Path:
    return simulate_to_directory(scenario, directory).metadata


def enr_db(scenario: Scenario) -> float:
    end_ns = scenario.start_time_ns + 1_000_000_000
    return float(
        np.mean([p.enr_db for p in World(scenario).truth(scenario.start_time_ns, end_ns)])
    )


def test_pseudo_doppler_from_samples_is_at_its_bound_with_one_pulse(tmp_path: Path) -> None:
    scenario = world(CIRCLE, tags=12, duration_s=9.0)
    recording = recorded(scenario, tmp_path / "iq")
    truth = {
        pulse.tag_id: pulse.bearing_deg
        for pulse in World(scenario).truth(
            scenario.start_time_ns, scenario.start_time_ns + 10**9
        )
    }
    errors, covered = [], []
    for one in detected(scenario):
        (found,) = switched_bearings(recording, [one])
        assert found.bearing.method == "pseudo_doppler"
        errors.append(difference_deg(found.bearing.bearing_deg, truth[one.pulse.tag_id]))
        low, high = found.bearing.interval90_deg or (0.0, 0.0)
        covered.append((truth[one.pulse.tag_id] - low) % 360.0 <= (high - low) % 360.0)
    array = read_switched_array(recording)
    # 16 ms of the 20 are used, in 11 of each 12 samples.
    counts = np.full(4, 0.016 * RATE_HZ * 11 / 12 / 4)
    snr = 10.0 ** (enr_db(scenario) / 10.0) / (0.020 * RATE_HZ)
    bound = np.sqrt(
        np.mean(
            [
                switched_bound_deg(array.steering(148.7e6), direction, snr, counts) ** 2
                for direction in np.arange(0.0, 90.0, 7.5)
            ]
        )
    )
    assert len(errors) > 60
    assert 2.0 < bound < 6.0
    assert np.sqrt(np.mean(np.square(errors))) < 1.25 * bound
    assert 0.8 < np.mean(covered) <= 1.0


@pytest.mark.parametrize("switch", [PAIR, ELEMENTS])
def test_a_pair_that_turns_a_little_finds_the_tag_by_phase_or_by_modes(
    tmp_path: Path, switch: AntennaSwitch
) -> None:
    scenario = world(switch, turn_deg=60.0)
    recording = recorded(scenario, tmp_path / "iq")
    (found,) = switched_bearings(recording, detected(scenario))
    truth = World(scenario).truth(scenario.start_time_ns, scenario.start_time_ns + 10**9)
    assert found.bearing.method == "two_point_phased"
    assert found.bearing.pulses == 7
    assert abs(difference_deg(found.bearing.bearing_deg, truth[0].bearing_deg)) < 4.0
    assert some(found.bearing.second_lobe_probability) < 0.01
    (turned,) = switched_bearings(recording, detected(scenario), offset_deg=30.0)
    off_deg = difference_deg(turned.bearing.bearing_deg, found.bearing.bearing_deg)
    assert off_deg == pytest.approx(30.0, abs=0.01)


def test_the_whole_way_from_a_scenario_to_a_bearing_by_the_command_line(
    tmp_path: Path, ran: Ran
) -> None:
    scenario = replace(world(CIRCLE, duration_s=12.0), seed=9)
    recording = recorded(scenario, tmp_path / "iq")
    pulses, placed = tmp_path / "pulses.jsonl", tmp_path / "placed.jsonl"
    ran("detect", recording, "--tags", tmp_path / "iq" / "tags.toml", "-o", pulses)
    telemetry = tmp_path / "iq" / "telemetry.csv"
    ran("attach", pulses, telemetry, "-o", placed, "--clock-offset", 0)
    (found,) = ran("bearing", placed, "--recording", recording, "--json").json
    truth = World(scenario).truth(scenario.start_time_ns, scenario.start_time_ns + 10**9)
    assert found["method"] == "pseudo_doppler"
    assert found["pulses"] >= 6
    assert abs(difference_deg(found["bearing_deg"], truth[0].bearing_deg)) < 5.0


@pytest.mark.parametrize("kind", KINDS)
def test_behind_a_gap_a_pulse_is_cut_at_its_true_time(tmp_path: Path, kind: str) -> None:
    scenario = world(CIRCLE)
    whole = recorded(scenario, tmp_path / "iq")
    start_ns = scenario.start_time_ns
    gap_s = (2.9, 2.9 + GAP_S)
    gapped = write_gapped(
        tmp_path / "band",
        np.fromfile(whole.with_suffix(".sigmf-data"), np.complex64),
        rate_hz=RATE_HZ,
        center_hz=148.7e6,
        start_ns=start_ns,
        gap_s=gap_s,
        kind=kind,
        **{SWITCH_KEY: json.loads(whole.read_text())["global"][SWITCH_KEY]},
    )
    behind = 0
    for one in detected(scenario):
        at_s = (one.pulse.start_time_ns - start_ns) / 1e9
        if gap_s[0] - 0.02 < at_s < gap_s[1]:
            with pytest.raises(UsageError, match="lies within the time of the recording"):
                switched_bearings(gapped, [one])
            continue
        behind += at_s > gap_s[1]
        (expected,) = switched_bearings(whole, [one])
        (found,) = switched_bearings(gapped, [one])
        off_deg = difference_deg(found.bearing.bearing_deg, expected.bearing.bearing_deg)
        assert abs(off_deg) < 1e-6
    assert behind >= 3


def test_a_recording_that_does_not_name_its_antennas_is_refused(tmp_path: Path) -> None:
    scenario = world(CIRCLE, duration_s=2.0)
    recording = recorded(scenario, tmp_path / "iq")
    content: dict[str, Any] = json.loads(recording.read_text())
    pulses = detected(scenario)
    later = detected(scenario.starting_at(scenario.start_time_ns + 10**12))
    with pytest.raises(UsageError, match="lies within the time of the recording"):
        switched_bearings(recording, later)
    with pytest.raises(UsageError, match="pose"):
        switched_bearings(recording, [replace(one, pose=None) for one in pulses])
    for wrong in ({"kind": "spiral"}, {"positions": 1}, {"dwell_samples": 1}, {"size_m": -1}):
        entry = content["global"][SWITCH_KEY] | wrong
        recording.write_text(
            json.dumps(content | {"global": content["global"] | {SWITCH_KEY: entry}})
        )
        with pytest.raises(FormatError, match="invalid"):
            read_switched_array(recording)
    del content["global"][SWITCH_KEY]
    recording.write_text(json.dumps(content))
    with pytest.raises(FormatError, match="does not specify the antenna"):
        switched_bearings(recording, pulses)


def test_a_switch_that_stays_too_long_is_refused(tmp_path: Path) -> None:
    scenario = world(replace(CIRCLE, dwell_s=0.004), duration_s=2.0)
    with pytest.raises(UsageError, match="does not reach every position"):
        switched_bearings(recorded(scenario, tmp_path / "iq"), detected(scenario))


def test_the_wavelength_is_that_of_the_pulse() -> None:
    assert pytest.approx(2.016, abs=1e-3) == SPEED_OF_LIGHT_M_S / 148.7e6
