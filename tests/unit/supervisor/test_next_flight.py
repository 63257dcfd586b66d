"""What ended again and again in one flight, and the next flight."""

import asyncio
from pathlib import Path

from uavrt.config.settings import RecordingSettings, Settings
from uavrt.core.clock import monotonic_s
from uavrt.drone.supervisor.mission.operator_commands import Mission
from uavrt.drone.supervisor.mission.saved_state import StateStore
from uavrt.drone.supervisor.start.launcher import Launcher
from uavrt.drone.supervisor.tree.instance import Instance
from uavrt.drone.supervisor.tree.process_tree import ProcessTree
from uavrt.drone.supervisor.tree.table import PROCESSES


def test_what_ended_again_and_again_in_one_flight_is_not_degraded_in_the_next(
    tmp_path: Path,
) -> None:
    mission = Mission(
        Settings(recording=RecordingSettings(directory=str(tmp_path))),
        StateStore(tmp_path),
        notify=lambda _severity, _text: None,
        on_start=lambda _flight: None,
        on_stop=lambda: None,
    )
    receiver = next(row for row in PROCESSES if row.name == "receiver")
    process_tree = ProcessTree(
        (receiver,),
        mission,
        launcher=Launcher(),
        workers=1,
        notify=lambda _severity, _text: None,
        on_line=lambda _instance, _line: None,
        on_output=lambda _instance, _line: None,
        wake=lambda: None,
    )
    instance: Instance = process_tree.instance_of(receiver)
    for _ in range(10):
        instance.restarts.started(monotonic_s())
        instance.restarts.ended(monotonic_s(), "ended (exit 1)")
    assert instance.status().status == "degraded: ended (exit 1)"
    asyncio.run(process_tree.stop_flight())
    assert instance.status().status == "stopped"
    assert instance.restarts.not_before_s == 0.0, "the next flight does not wait for it"
