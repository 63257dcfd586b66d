"""`uavrt fly` and the missions and fences of an autopilot."""

import asyncio
import json
import threading
from collections.abc import Iterator
from pathlib import Path

import made
import pytest
from some import some

from uavrt.cli.system.fly import fly
from uavrt.core.clock import Clock
from uavrt.core.errors import ConfigError, PlanError
from uavrt.core.messages import KeepOut, Pose, VehicleFence
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.vehicle.fake_autopilot import AutopilotSettings, FakeAutopilot

FIELD = ((46.5, 8.0), (46.5, 8.002), (46.501, 8.002), (46.501, 8.0))


class Vehicle:
    """A simulated autopilot that hovers, in a thread of its own."""

    def __init__(self) -> None:
        self.port, clock = free_udp_port(), Clock.start()
        settings = AutopilotSettings(
            companion=("127.0.0.1", free_udp_port()),
            ground=("127.0.0.1", self.port),
            flies=True,
        )
        self.autopilot = FakeAutopilot(self._pose, settings, clock)
        self._loop = asyncio.new_event_loop()
        self._task: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    @property
    def address(self) -> str:
        return f"udpin://127.0.0.1:{self.port}"

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._end)
        self._thread.join()

    def holds_fence(self, fence: VehicleFence) -> None:
        self.autopilot.missions.held[1] = made.mission_items(made.fence_items(fence), 1)

    def _end(self) -> None:
        some(self._task).cancel()

    def _serve(self) -> None:
        self._task = self._loop.create_task(self.autopilot.run())
        with pytest.raises(asyncio.CancelledError):
            self._loop.run_until_complete(self._task)
        self._loop.close()

    @staticmethod
    def _pose(time_ns: int) -> Pose:
        return made.pose(time_ns, 46.5, 8.0, altitude_amsl_m=840.0)


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    made = Vehicle()
    yield made
    made.close()


def meadow(directory: Path) -> Path:
    path = directory / "meadow.geojson"
    ring = [[east, north] for north, east in (*FIELD, FIELD[0])]
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    return path


def test_a_survey_is_uploaded_and_read_back(
    vehicle: Vehicle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        fly(
            "survey",
            area=meadow(tmp_path),
            height=60.0,
            spacing=40.0,
            upload=True,
            mavlink=vehicle.address,
        )
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert "the vehicle has the survey: 7 items, read back" in said
    assert "not checked: its battery, and the ground below the path" in said
    held = vehicle.autopilot.missions.held[0]
    assert [item.command for item in held] == [16] * 6 + [20]
    assert some(vehicle.autopilot.flown).vehicle.target is None


def test_a_survey_out_of_the_vehicles_fence_or_far_from_its_home_is_not_uploaded(
    vehicle: Vehicle, tmp_path: Path
) -> None:
    options = {"area": meadow(tmp_path), "height": 60.0, "spacing": 40.0, "upload": True}
    with pytest.raises(PlanError, match=r"leads \d+ m from the vehicle's home") as refused:
        fly("survey", farthest=50.0, mavlink=vehicle.address, **options)  # type: ignore[arg-type]
    assert "--farthest" in (refused.value.remedy or "")
    fence = VehicleFence(within=(KeepOut(places=((46.5, 8.0),), radius_m=100.0),))
    vehicle.holds_fence(fence)
    with pytest.raises(PlanError, match="vehicle's fence"):
        fly("survey", mavlink=vehicle.address, **options)  # type: ignore[arg-type]
    assert not vehicle.autopilot.missions.held[0]


def test_a_saved_survey_says_what_nobody_has_checked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fly("survey", area=meadow(tmp_path), height=60.0, save=tmp_path / "meadow.plan")
    said = capsys.readouterr().out
    assert "not checked: the vehicle's fence, home, battery, and the ground" in said


def test_the_vehicles_fence_is_shown_and_saved(
    vehicle: Vehicle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vehicle.holds_fence(VehicleFence(within=(KeepOut(places=((46.5, 8.0),), radius_m=250.0),)))
    saved = tmp_path / "fence.plan"
    with pytest.raises(SystemExit) as ended:
        fly("fence", save=saved, mavlink=vehicle.address)
    assert ended.value.code == 0
    assert "areas to stay within: 1, to keep out of: 0" in capsys.readouterr().out
    (circle,) = json.loads(saved.read_text())["geoFence"]["circles"]
    assert circle["circle"] == {"center": [46.5, 8.0], "radius": 250.0}
    assert circle["inclusion"] is True


def test_only_a_survey_is_uploaded_and_a_fence_is_a_plan(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="only a survey can be uploaded"):
        fly("hold", upload=True)
    with pytest.raises(ConfigError, match="a fence can be saved only as"):
        fly("fence", save=tmp_path / "fence.json")
