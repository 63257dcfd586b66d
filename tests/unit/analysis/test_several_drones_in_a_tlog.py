"""One ground station, several drones, one telemetry log."""

import struct
from dataclasses import replace
from pathlib import Path

import numbered
import pytest
from command_line import uavrt
from some import some

from uavrt.analysis.archive.recordings import read_manifest
from uavrt.analysis.archive.steps.remedies import by_manifest
from uavrt.analysis.tracks.recognised import read_track
from uavrt.core.errors import FormatError
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.simulation.vehicle.vehicle_telemetry import telemetry_message

POSE = some(numbered.pulse_pose(1).pose)
IDS = (dialect.AttitudeQuaternion.ID, dialect.GlobalPositionInt.ID, dialect.SystemTime.ID)


def written(path: Path, vehicles: dict[int, float]) -> Path:
    """A log of vehicles, by number and latitude, for ten seconds."""
    writers = {number: FrameWriter(number, 1) for number in vehicles}
    out = b""
    for second in range(10):
        time_ns = POSE.time_ns + second * 10**9
        for number, latitude_deg in vehicles.items():
            pose = replace(POSE, time_ns=time_ns, latitude_deg=latitude_deg)
            for one in IDS:
                message = telemetry_message(one, pose, 40_000 + 1000 * second, time_ns)
                out += struct.pack(">Q", time_ns // 1000) + writers[number].encode(message)
    path.write_bytes(out)
    return path


def test_the_vehicle_with_the_receiver_has_to_be_named(tmp_path: Path) -> None:
    path = written(tmp_path / "both.tlog", {1: 46.0, 2: 46.01})
    with pytest.raises(FormatError, match=r"contains vehicles 1 and 2\. .*--vehicle"):
        read_track(path)
    for vehicle, latitude_deg in ((1, 46.0), (2, 46.01)):
        track = read_track(path, vehicle)
        assert {one.latitude_deg for one in track.positions} == {latitude_deg}
        assert len(track.attitudes) == 10
    with pytest.raises(FormatError, match=r"no vehicle 3\. The log contains 1 and 2"):
        read_track(path, 3)


def test_a_log_of_one_vehicle_needs_no_name(tmp_path: Path) -> None:
    path = written(tmp_path / "one.tlog", {7: 46.0})
    assert read_track(path) == read_track(path, 7)


def test_attach_and_integrate_take_the_vehicles_number(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(written(tmp_path / "both.tlog", {1: 46.0, 2: 46.01}))
    pulses = tmp_path / "pulses.csv"
    pulses.write_text("tag_id,start_time_ns\n")
    for line in (
        ("attach", str(pulses), path, "-o", str(tmp_path / "posed.csv")),
        ("integrate", "--track", path, "--recording", path, "--tags", str(tags_file(tmp_path))),
    ):
        assert uavrt(*line) == 2
        assert "contains vehicles 1 and 2" in capsys.readouterr().err
        uavrt(*line, "--vehicle", "2")
        assert "contains vehicles" not in capsys.readouterr().err
    assert uavrt("integrate", str(tmp_path), "--vehicle", "2") == 2
    assert "--vehicle and --yaw-offset need --track" in capsys.readouterr().err


def tags_file(directory: Path) -> Path:
    path = directory / "TagInfo.txt"
    path.write_text("2, 148710000, 1254, 20, 60, 10, 3, 0.005\n")
    return path


def test_the_manifest_of_a_batch_names_the_vehicle_of_a_track(tmp_path: Path) -> None:
    written(tmp_path / "both.tlog", {1: 46.0, 2: 46.01})
    (tmp_path / "a.cf32").write_bytes(bytes(80))
    manifest = tmp_path / "manifest.csv"
    manifest.write_text("path,track,vehicle\na.cf32,both.tlog,2\n")
    (found,) = read_manifest(manifest).values()
    assert found.vehicle == 2
    with pytest.raises(FormatError) as refused:
        read_track(some(found.track))
    assert "with vehicle (in --manifest)" in by_manifest(str(refused.value))
