import csv
import json
from pathlib import Path

import numpy as np
import pytest
import sigmf

from uavrt.cli.system.simulate import simulate
from uavrt.config.tags.tag_files import read_tags
from uavrt.core.errors import ConfigError, RecordingError
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.scenario_file import load_scenario
from uavrt.simulation.scene.world import World
from uavrt.simulation.simulated_recording import SimulatedRecording, simulate_to_directory
from uavrt.simulation.synthesis import IQSynthesizer

RATE_HZ = 250_000.0


SCENARIO = demo_scenario(60.0, seed=6)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> SimulatedRecording:
    """Nine seconds of the demo."""
    directory = tmp_path_factory.mktemp("nine") / "out"
    return simulate_to_directory(SCENARIO, directory, duration_s=9.0, sample_rate_hz=RATE_HZ)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_recording_is_valid_sigmf_with_the_right_samples(
    recorded: SimulatedRecording,
) -> None:
    recording = sigmf.fromfile(str(recorded.metadata))
    recording.validate()
    assert recording.get_global_info()["core:datatype"] == "cf32_le"
    assert recording.sample_rate == RATE_HZ
    capture = recording.get_captures()[0]
    assert capture["core:frequency"] == 148.68e6
    assert capture["core:datetime"] == "2023-11-17T07:16:59.000000Z"
    expected = IQSynthesizer(SCENARIO, sample_rate_hz=RATE_HZ).block(0, 2_250_000)
    np.testing.assert_array_equal(recording.read_samples(), expected)


def test_the_integer_recording_differs_only_by_its_rounding(tmp_path: Path) -> None:
    scenario = demo_scenario(60.0)
    result = simulate_to_directory(
        scenario, tmp_path, duration_s=1.0, sample_rate_hz=RATE_HZ, sample_format="cs16"
    )
    sigmf.fromfile(str(result.metadata)).validate()
    pairs = np.fromfile(result.data, "<i2").astype(np.float32) / 32767
    expected = IQSynthesizer(scenario, sample_rate_hz=RATE_HZ).block(0, 250_000)
    np.testing.assert_allclose(pairs.view(np.complex64), expected, atol=1 / 32767)


def test_tags_that_the_band_does_not_reach_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    simulate("demo", output=tmp_path / "wide", duration=0.1, sample_rate=RATE_HZ)
    assert "outside" not in capsys.readouterr().err
    simulate("demo", output=tmp_path / "narrow", duration=0.1, sample_rate=20e3)
    said = " ".join(capsys.readouterr().err.split())
    frequencies = {tag.tag_id: tag.frequency_hz for tag in demo_scenario(60.0).tags}
    outside = [one for one, hz in frequencies.items() if abs(hz - 148.68e6) >= 10e3]
    assert outside
    assert (
        f"outside the recorded band and not in the recording: {', '.join(map(str, outside))}."
        in said
    )


def test_truth_telemetry_and_tags_stand_beside_the_samples(
    recorded: SimulatedRecording,
) -> None:
    start = SCENARIO.start_time_ns
    pulses = World(SCENARIO).truth(start, start + 9 * 10**9)
    written = rows(recorded.truth)
    assert [int(row["start_time_ns"]) for row in written] == [p.start_time_ns for p in pulses]
    assert [float(row["enr_db"]) for row in written] == [p.enr_db for p in pulses]
    telemetry = rows(recorded.telemetry)
    assert len(telemetry) == 9 * 50 + 1
    for row in telemetry[::90]:
        pose = SCENARIO.vehicle_pose(int(row["time_ns"]))
        assert float(row["latitude_deg"]) == pytest.approx(pose.latitude_deg, abs=1e-9)
        assert float(row["qz"]) == pytest.approx(pose.quaternion_wxyz[3], abs=1e-7)
    assert read_tags(recorded.tags) == SCENARIO.tags
    assert [tag.tag_id for tag in read_tags(recorded.tag_info)] == [2, 4, 6]
    assert load_scenario(recorded.scenario).tag == SCENARIO.tag
    notes = json.loads(recorded.metadata.read_text())["annotations"]
    assert len(notes) == len(pulses)
    assert notes[0]["core:label"] == f"tag {pulses[0].tag_id}"


@pytest.mark.parametrize(
    ("name", "duration_s", "fault"),
    [
        ("", 0.1, "not empty"),
        ("precious/out", 0.1, "cannot be written"),
        ("out", 1e9, "needs 24000000000 MB"),
    ],
)
def test_what_cannot_be_recorded_is_refused_and_overwrites_nothing(
    tmp_path: Path, name: str, duration_s: float, fault: str
) -> None:
    (tmp_path / "precious").write_text("data")
    with pytest.raises(RecordingError, match=fault):
        simulate_to_directory(SCENARIO, tmp_path / name, duration_s=duration_s)
    assert [path.name for path in tmp_path.iterdir()] == ["precious"]
    assert (tmp_path / "precious").read_text() == "data"


@pytest.mark.parametrize("duration_s", [0.0, -1.0, float("nan"), float("inf")])
def test_a_length_that_is_none_is_refused(tmp_path: Path, duration_s: float) -> None:
    with pytest.raises(ConfigError, match="cannot record"):
        simulate_to_directory(demo_scenario(), tmp_path, duration_s=duration_s)


def test_the_command_records_the_demo_and_its_own_scenario_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    simulate("demo", output=first, duration=1.0, seed=3, sample_rate=RATE_HZ)
    simulate(str(first / "scenario.toml"), output=second, sample_rate=RATE_HZ)
    assert "250000 samples" in capsys.readouterr().out
    data = "simulation.sigmf-data"
    assert (first / data).read_bytes() == (second / data).read_bytes()
