"""Pulses as JSON lines and CSV: their fields, and back."""

import csv
import io
import json
import math
from dataclasses import replace
from pathlib import Path

import numbered
import pytest

from uavrt.core.errors import FormatError
from uavrt.core.messages import BurstInside, Pulse, PulsePose
from uavrt.flight.logs.pulse_files import (
    PulseFormat,
    PulseWriter,
    pulse_format,
    read_pulse_file,
)

# Written a second time: programs outside rely on it, also on the
# order: what came later is at the end.
FIELDS = """tag_id, frequency_hz, start_time_ns, end_time_ns, snr_db, group_snr_db, score,
group_index, group_sequence, noise_psd, detection_status, confirmed, rate,
predicted_next_start_ns, predicted_next_end_ns, latitude_deg, longitude_deg, altitude_amsl_m,
altitude_relative_m, quaternion_wxyz, also_possible_tag_ids, ghost_of_tag_id,
clipped""".replace("\n", " ").split(", ")


def written(form: PulseFormat, pulses: list[PulsePose | Pulse]) -> str:
    stream = io.StringIO()
    writer = PulseWriter(stream, form)
    for pulse in pulses:
        writer.write(pulse)
    assert writer.written == len(pulses)
    return stream.getvalue()


def file_of(text: str | bytes, directory: Path, form: str = "jsonl") -> Path:
    path = directory / f"pulses.{form}"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_a_json_line_has_exactly_the_promised_fields() -> None:
    record = json.loads(written("jsonl", [numbered.pulse_pose()]))
    assert list(record) == FIELDS
    assert record["start_time_ns"] == numbered.pulse_pose().pulse.start_time_ns
    assert record["confirmed"] is True
    assert record["quaternion_wxyz"] == [0.700764, 0.00189066, -0.00109068, 0.71339]


def test_a_csv_row_has_exactly_the_promised_fields() -> None:
    (row,) = csv.DictReader(io.StringIO(written("csv", [numbered.pulse_pose()])))
    assert list(row) == FIELDS
    assert row["quaternion_wxyz"] == "0.700764 0.00189066 -0.00109068 0.71339"
    assert row["confirmed"] == "true"


@pytest.mark.parametrize("form", ["csv", "jsonl"])
def test_pulses_survive_a_round_trip(tmp_path: Path, form: PulseFormat) -> None:
    posed = [numbered.pulse_pose(n, tag) for n in range(3) for tag in (2, 4)]
    bare = PulsePose(
        pulse=replace(
            posed[0].pulse,
            predicted_next_start_ns=None,
            predicted_next_end_ns=None,
            confirmed=False,
            detection_status="subthreshold",
            also_possible_tag_ids=(4, 6),
            ghost_of_tag_id=8,
            clipped=True,
        ),
        pose=None,
    )
    path = file_of(written(form, [*posed, bare]), tmp_path, form)
    assert read_pulse_file(path) == (*posed, bare)
    assert pulse_format(path.name) == form


def test_what_came_after_a_burst_is_read_into_it(tmp_path: Path) -> None:
    burst, other = numbered.pulse_pose(0), numbered.pulse_pose(1)
    inside = BurstInside(
        tag_id=burst.pulse.tag_id,
        start_time_ns=burst.pulse.start_time_ns,
        burst_starts_ns=(burst.pulse.start_time_ns, burst.pulse.start_time_ns + 25_000_000),
        burst_snrs_db=(20.0, 21.0),
        also_possible_tag_ids=(4,),
    )
    path = tmp_path / "pulses.jsonl"
    with path.open("w") as stream:
        writer = PulseWriter(stream, "jsonl")
        writer.write(burst)
        writer.write(other)
        writer.write_inside(inside)
    assert read_pulse_file(path) == (
        PulsePose(pulse=inside.put_into(burst.pulse), pose=burst.pose),
        other,
    )


def test_files_of_older_versions_say_nothing_of_other_tags(tmp_path: Path) -> None:
    item = numbered.pulse_pose()
    record = json.loads(written("jsonl", [item]))
    for name in ("also_possible_tag_ids", "ghost_of_tag_id", "clipped"):
        del record[name]
    assert read_pulse_file(file_of(json.dumps(record) + "\n", tmp_path)) == (item,)


@pytest.mark.parametrize("form", ["csv", "jsonl"])
def test_what_is_not_finite_is_written_as_unknown(tmp_path: Path, form: PulseFormat) -> None:
    odd = replace(numbered.pulse_pose().pulse, noise_psd=math.nan, snr_db=-math.inf)
    text = written(form, [odd])
    assert "NaN" not in text
    assert "inf" not in text.lower()
    (read,) = read_pulse_file(file_of(text, tmp_path, form))
    assert math.isnan(read.pulse.noise_psd)
    assert math.isnan(read.pulse.snr_db)


@pytest.mark.parametrize("form", ["csv", "jsonl"])
def test_an_unfinished_last_line_is_passed_over(tmp_path: Path, form: PulseFormat) -> None:
    torn = written(form, [numbered.pulse_pose(0), numbered.pulse_pose(1)])[:-10]
    assert read_pulse_file(file_of(torn, tmp_path, form)) == (numbered.pulse_pose(0),)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (b"\xff\x00" * 50, "cannot read"),
        ("{}\n", "line 1 is not a pulse: 'tag_id'"),
        ("\nnonsense\n", "line 2"),
        ("[1]\n", "line 1"),
        ("tag_id,frequency_hz\n2\n", "line 2"),
        ("tag_id,frequency_hz\n2,x\n", "line 2"),
    ],
)
def test_what_is_no_pulse_is_refused(tmp_path: Path, text: str | bytes, word: str) -> None:
    with pytest.raises(FormatError, match=word):
        read_pulse_file(file_of(text, tmp_path, "txt"))


@pytest.mark.parametrize(
    ("field", "value"),
    [("detection_status", "sure"), ("confirmed", "yes"), ("tag_id", None), ("rate", "one")],
)
def test_a_field_of_a_wrong_kind_is_refused(tmp_path: Path, field: str, value: object) -> None:
    record = json.loads(written("jsonl", [numbered.pulse_pose()])) | {field: value}
    with pytest.raises(FormatError, match="line 1 is not a pulse"):
        read_pulse_file(file_of(json.dumps(record) + "\n", tmp_path))


@pytest.mark.parametrize("form", ["csv", "jsonl"])
@pytest.mark.parametrize("damage", ["nonsense", "\xff\xfe", "", "{}", "2,3"])
def test_damaged_lines_among_good_ones_are_read_around_and_counted(
    tmp_path: Path, form: PulseFormat, damage: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pulses = [numbered.pulse_pose(number) for number in range(3)]
    lines = written(form, [*pulses]).splitlines(keepends=True)
    content = [line.encode() for line in lines]
    content.insert(len(content) - 1, damage.encode("latin-1") + b"\n")
    path = file_of(b"".join(content), tmp_path, form)
    assert read_pulse_file(path) == tuple(pulses)
    told = capsys.readouterr().err
    assert ("damaged lines skipped" in told) is bool(damage)
