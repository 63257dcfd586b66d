"""The page's own words for a pulse agree with the dataclass."""

import math
import re
from pathlib import Path

import made

from uavrt.core.messages import Pose, Pulse, PulsePose
from uavrt.flight.database import schema
from uavrt.flight.database.fields import RecordField, fields_of
from uavrt.flight.logs.pulse_files import FIELDS
from uavrt.ground.store.stored_flights import PULSE_COLUMNS, STATUSES, pulse_cells
from uavrt.ground.web.work.column_answers import YAW

PAGE = Path(__file__).parents[3] / "page/src"
TYPES = {"whole": "number", "real": "number", "switch": "boolean", "word": "string"}
OF_THE_SERVER = {"received_ns", "flight_id"}
"""What the ground station adds to a pulse."""


def in_typescript(field: RecordField, *, of_pose: bool) -> str:
    """Write the type that a field has in JSON: what is unknown or no number is null."""
    if field.kind == "wholes":
        return "number[]"
    plain = TYPES.get(field.kind, f"[{', '.join(['number'] * (field.length or 0))}]")
    null = of_pose or field.optional or field.kind == "real"
    return f"{plain} | null" if null else plain


def test_the_pages_record_of_a_pulse_has_the_types_of_the_dataclass() -> None:
    text = (PAGE / "types.ts").read_text(encoding="utf-8")
    (body,) = re.findall(r"interface PulseRecord \{(.*?)\}", text, re.DOTALL)
    written = dict(re.findall(r"^\s*(\w+): (.*);$", body, re.MULTILINE))
    expected = {
        one.name: in_typescript(one, of_pose=record is Pose)
        for record in (Pulse, Pose)
        for one in fields_of(record)
    }
    assert set(written) - OF_THE_SERVER <= set(FIELDS)
    for name in set(written) - OF_THE_SERVER:
        assert written[name] == expected[name], name


def test_the_page_asks_for_columns_that_there_are() -> None:
    text = (PAGE / "shared/pulses.ts").read_text(encoding="utf-8")
    (body,) = re.findall(r"PULSE_NAMES = \[(.*?)\]", text, re.DOTALL)
    names = re.findall(r'"(\w+)"', body)
    assert names
    assert set(names) <= {*PULSE_COLUMNS, YAW}
    (statuses,) = re.findall(r'status: \[("subthreshold".*?)\]', text)
    assert tuple(re.findall(r'"(\w+)"', statuses)) == STATUSES


def test_every_column_is_a_field_of_a_pulse_or_of_its_pose() -> None:
    fields = {*schema.PULSES.types, *schema.POSES.types}
    # Of the other tags that a pulse may be of the first.
    assert set(PULSE_COLUMNS) - {"also_possible_tag_id"} <= fields


def test_a_pulse_without_pose_and_doubts_is_a_row_of_numbers() -> None:
    cells = dict(
        zip(
            PULSE_COLUMNS,
            pulse_cells(PulsePose(pulse=made.pulse(5_000), pose=None)),
            strict=True,
        )
    )
    assert cells["start_time_ns"] == 5_000
    assert math.isnan(cells["latitude_deg"])
    assert math.isnan(cells["also_possible_tag_id"])
    assert math.isnan(cells["ghost_of_tag_id"])
    assert cells["clipped"] == 0
