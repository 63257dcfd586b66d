"""The one way in which experiments judge, draw and file their figures."""

import csv
import re
from pathlib import Path
from typing import Any

import pytest

from uavrt_experiments.recovery.report import Kill, RecoveryReport
from uavrt_experiments.resources.report import Load, cpu_table
from uavrt_experiments.result import Row
from uavrt_experiments.tables import aligned, drawn, write_rows

SOURCE = Path(__file__).parents[3] / "claims"


def test_no_experiment_lays_out_or_files_its_tables_by_itself() -> None:
    files = list((SOURCE / "uavrt_experiments").rglob("*.py"))
    assert len(files) > 60
    own = {
        path.name
        for path in files
        if re.search(
            r"rich\.table|csv\.writer|[lr]just\(|\"NOT met\"", path.read_text(encoding="utf-8")
        )
    }
    assert own == {"tables.py", "result.py"}


def test_what_was_counted_has_no_interval_and_columns_without_a_word_are_left_out() -> None:
    rows = [
        Row.counted("x", "pulses missing", "12 ms", 4, 1486, most=0, original=3),
        Row.counted("x", "pulses missing", "20 ms", 0, 1486, most=0),
    ]
    heading, first, second = drawn(rows).splitlines()
    assert heading.split() == ["quantity", "case", "measured", "n", "bar", "original"]
    assert " ".join(first.split()) == "pulses missing 12 ms 4 1486 ≤ 0 NOT met 3"
    assert " ".join(second.split()) == "pulses missing 20 ms 0 1486 ≤ 0 met"


def test_rows_of_several_experiments_are_named_and_filed_with_their_bars(
    tmp_path: Path,
) -> None:
    rows = [
        Row.counted("a", "time, s", "", 1.5, least=1.0),
        Row.counted("b", "time, s", "", 2.0),
    ]
    assert [line.split()[0] for line in drawn(rows, "Both").splitlines()] == [
        *("Both", "quantity", "a", "b")
    ]
    write_rows(tmp_path / "rows.csv", rows)
    with (tmp_path / "rows.csv").open(encoding="utf-8", newline="") as file:
        found = list(csv.DictReader(file))
    assert [(row["experiment"], row["value"], row["least"]) for row in found] == [
        ("a", "1.5", "1.0"),
        ("b", "2.0", ""),
    ]


def test_numbers_stand_flush_right() -> None:
    assert aligned([("name", "n"), ("a", "100")], numbers_from=1) == "name    n\na     100"


LOSSES = ("lost_from_database", "lost_from_log", "lost_on_ground", "orphans")


def recovery(resumed_s: float, **lost: int) -> RecoveryReport:
    nothing: dict[str, Any] = dict.fromkeys(LOSSES, 0)
    kill = Kill(process="detector-1", how="SIGKILL", resumed_s=resumed_s, limit_s=2.0)
    return RecoveryReport(
        seed=1,
        kills=(kill,),
        pulses_recorded=9,
        pulses_detected=10,
        pulses_promised=10,
        without_pose=1,
        flights=1,
        **(nothing | lost),
    )


def test_recovery_holds_only_if_each_kill_kept_its_limit_and_nothing_is_lost() -> None:
    assert recovery(1.9).ok
    assert not recovery(2.1).ok
    assert not any(recovery(1.0, **{name: 1}).ok for name in LOSSES)
    lines = drawn(recovery(2.1, lost_on_ground=3).rows()).splitlines()
    missed = [line for line in lines if "NOT met" in line]
    assert missed == [line for line in lines if "detector" in line or "the ground" in line]


@pytest.mark.parametrize(
    ("behind_s", "lost", "real_time"),
    [(0.5, 0.0, True), (2.5, 0.0, False), (0.5, 1.0, False), (float("inf"), 0.0, False)],
)
def test_a_load_is_in_real_time_without_delay_and_loss(
    behind_s: float, lost: float, real_time: bool
) -> None:
    load = Load(tags=100, cpu_percent=20.0, behind_s=behind_s, lost_samples=lost)
    assert load.real_time is real_time


def test_a_table_of_processors_has_the_statistics_of_the_thesis_and_a_bar() -> None:
    title, heading, first, second = cpu_table(
        "Here", (1, 5), {"receiver": (10.0, 30.0), "recorder": (1.0, 1.0)}
    ).splitlines()
    assert title == "Here"
    assert " ".join(heading.split()) == "process 1 min 5 min mean sd median min max range"
    assert " ".join(first.split()) == (
        "receiver 10.00 30.00 20.00 14.14 20.00 10.00 30.00 20.00 " + "█" * 20
    )
    assert second.split()[-1] == "█"
