"""A field of a record is a column of the database and of the files, without a second list."""

import sqlite3
from dataclasses import fields, make_dataclass, replace
from typing import Any

import made
import pytest

from uavrt.core.messages import Pulse, PulsePose, Tag
from uavrt.flight.database import schema
from uavrt.flight.database.fields import fields_of
from uavrt.flight.logs.pulse_files import BURST_FIELDS, FIELDS, pulse_from_record, pulse_record

FULL = replace(
    made.pulse(5_000),
    also_possible_tag_ids=(4, 6),
    ghost_of_tag_id=8,
    clipped=True,
    burst_starts_ns=(5_000, 9_000),
    burst_snrs_db=(12.5, 11.0),
)


def test_every_field_of_a_pulse_is_a_column_of_the_database_and_of_the_files() -> None:
    names = [one.name for one in fields(Pulse)]
    assert schema.PULSE_COLUMNS.split(", ") == names
    assert set(names) <= {*FIELDS, *BURST_FIELDS}


def test_every_field_of_a_pulse_comes_back_from_the_database_and_from_the_files() -> None:
    usual = made.pulse(5_000)
    changed = [one.name for one in fields_of(Pulse) if one.defaulted]
    assert all(getattr(FULL, name) != getattr(usual, name) for name in changed)
    database = sqlite3.connect(":memory:")
    schema.bring_up_to_date(database)
    for pulse in (usual, replace(FULL, start_time_ns=6_000)):
        database.execute(schema.INSERT_PULSE, schema.PULSES.row(pulse))
        record = pulse_record(PulsePose(pulse=pulse, pose=None))
        assert pulse_from_record(record).pulse == pulse
    rows = database.execute(f"SELECT {schema.PULSE_COLUMNS} FROM pulses").fetchall()
    database.close()
    assert [schema.pulse_from_row(row) for row in rows] == [
        usual,
        replace(FULL, start_time_ns=6_000),
    ]


def test_the_kinds_of_fields_derive_from_their_types() -> None:
    kinds = {one.name: (one.kind, one.optional, one.defaulted) for one in fields_of(Pulse)}
    assert kinds["snr_db"] == ("real", False, False)
    assert kinds["predicted_next_start_ns"] == ("whole", True, False)
    assert kinds["detection_status"] == ("word", False, False)
    assert kinds["also_possible_tag_ids"] == ("wholes", False, True)
    assert kinds["ghost_of_tag_id"] == ("whole", True, True)


def test_a_type_that_no_column_holds_is_a_fault_of_the_program() -> None:
    odd: Any = make_dataclass("Odd", [("tag", Tag)])
    with pytest.raises(TypeError, match="no database column can hold"):
        fields_of(odd)


def test_a_pulse_with_a_status_of_a_newer_version_does_not_bar_the_others() -> None:
    place = schema.PULSE_COLUMNS.split(", ").index("detection_status")
    row = list(schema.PULSES.row(made.pulse(0)))
    row[place] = "of a newer version"
    found: str = schema.pulse_from_row(tuple(row)).detection_status
    assert found == "of a newer version"
