import importlib
from dataclasses import replace
from pathlib import Path

import pytest
from process_tables import processes_markdown, topics_markdown

from uavrt.config.settings import (
    BearingSettings,
    DetectionSettings,
    GuidanceSettings,
    IntegrationSettings,
    Ros2Settings,
    Settings,
    Shape,
)
from uavrt.core.commands import SystemState
from uavrt.drone.ipc.topics import TOPICS
from uavrt.drone.supervisor.tree.process_shapes import SHAPES, rows_for
from uavrt.drone.supervisor.tree.table import PROCESSES, SUPERVISOR_TOPICS, consumers_of

PUBLISHED_BY_SUPERVISOR = {
    "corrected_tags",
    "operation",
    "settings",
    "assignment",
    "flight",
    "flight_end",
    "command_reply",
    "system_status",
    "status_text",
}
EVERYTHING = Settings(
    ros2=Ros2Settings(enabled=True),
    bearings=BearingSettings(on_drone=True),
    integration=IntegrationSettings(on_drone=True),
    guidance=GuidanceSettings(enabled=True),
)


def test_producers_stand_after_their_consumers() -> None:
    names = [row.name for row in PROCESSES]
    assert names.index("receiver") > names.index("detector") > names.index("connection")


def test_only_the_sample_chain_depends_on_the_state() -> None:
    running = {
        state: {row.name for row in PROCESSES if row.runs(state)} for state in SystemState
    }
    always = {"recorder", "connection", "estimator", "integrator", "guide", "ros2"}
    assert running[SystemState.DETECTING] == {*always, "detector", "receiver"}
    assert running[SystemState.IDLE] == always


def test_the_gateway_and_the_guide_run_only_where_they_are_asked_for() -> None:
    assert set(rows_for(EVERYTHING)) == set(PROCESSES)
    left_out = {row.name for row in set(PROCESSES) - set(rows_for(Settings()))}
    assert left_out == {"ros2", "estimator", "integrator", "guide"}


@pytest.mark.parametrize("shape", SHAPES)
def test_in_every_shape_records_and_samples_have_both_ends(shape: Shape) -> None:
    rows = rows_for(replace(EVERYTHING, detection=DetectionSettings(shape=shape)))
    names = [row.name for row in rows]
    produced = {topic for row in rows for topic in row.produces}
    assert {"pulse", "search_report", "pulse_pose", "poses", "command"} <= produced
    for row in rows:
        assert callable(importlib.import_module(row.module).main)
        assert {*row.consumes, *row.produces} <= {*TOPICS}
        assert {*row.consumes} <= produced | PUBLISHED_BY_SUPERVISOR
        for topic in row.produces:
            assert topic in SUPERVISOR_TOPICS or consumers_of(topic, rows)
        if row.samples_to is not None:
            # Consumers stand before producers, here as everywhere.
            assert names.index(row.samples_to) < names.index(row.name)


def test_the_shape_that_flies_is_the_table() -> None:
    assert SHAPES[DetectionSettings().shape] is PROCESSES


PAGE = Path(__file__).parents[3] / "docs/explanation/supervision.md"


@pytest.mark.parametrize("make", [processes_markdown, topics_markdown])
def test_the_manual_shows_the_table_as_it_is(make: object) -> None:
    assert callable(make)
    text = PAGE.read_text(encoding="utf-8")
    assert make() in text, "put in the output of python tests/drivers/process_tables.py"
