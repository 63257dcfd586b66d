"""How sure it is that coded tags are not mistaken, and what too few hours cannot show."""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from uavrt_experiments.detection.coded import E23, Mistaken, find, mistake
from uavrt_experiments.tables import bars_kept

BESIDE = next(one for one in E23.cases if one.name == "50 codes, two tags at 30 dB")


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The benchmark of coded tags, which is beside the sources and no part of them."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[3]))
    return import_module("benchmarks.bench_coded")


def test_nothing_wrong_in_a_few_hours_is_no_bar_met() -> None:
    few = [Mistaken(code_hours=2.8, wrong=0) for _ in range(10)]
    (row,) = BESIDE.rows(few)
    assert row.verdict == "not shown"
    assert row.note == "at most 0.132; see the power law of `benchmarks coded`"
    assert bars_kept([row]) == (
        "0 of 0 requirements met; of the 0 missed, 0 lie outside the 95 % interval; "
        "1 more are not shown"
    )


def test_enough_hours_show_a_bar_and_a_wrong_code_breaks_it() -> None:
    (long,) = BESIDE.rows([Mistaken(code_hours=10_000.0, wrong=0) for _ in range(10)])
    assert (long.verdict, long.note) == ("met", "")
    (broken,) = BESIDE.rows([Mistaken(code_hours=2.8, wrong=2) for _ in range(10)])
    assert broken.verdict == "NOT met"


@pytest.mark.parametrize(("listed", "heard"), [(True, {1}), (False, set())])
def test_a_listed_or_an_unlisted_code_sends(
    listed: bool, heard: set[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    told: set[int] = set()

    def finding(*arguments: Any, **more: Any) -> Any:
        found = find(*arguments, **more)
        told.update(one.tag_id for one in found if one.confirmed)
        return found

    monkeypatch.setattr("uavrt_experiments.detection.coded.find", finding)
    rng = np.random.default_rng(5)
    made = mistake(rng, strong_db=30.0, seconds=12.0, listed=listed, unlisted=not listed)
    assert made.wrong == 0
    assert told == heard


def test_the_number_of_stretches_is_settable(
    bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert bench.stretches_asked() == 10
    monkeypatch.setenv("UAVRT_STRETCHES", "100")
    assert bench.stretches_asked() == 100
    monkeypatch.setenv("UAVRT_STRETCHES", "many")
    with pytest.raises(SystemExit, match="give a number of stretches"):
        bench.stretches_asked()


def test_a_power_law_through_too_few_counts_is_not_read_off(bench: Any) -> None:
    table = bench.wrong_identities(listed=False, stretches=2, stretch_s=8.0)
    assert "one that is not listed" in table.title
    lowered = ["limits for 1", "limits for 3", "limits for 10"]
    assert [row[0] for row in table.rows][:3] == lowered
    assert table.rows[-1][2:] == ["too few were seen for it", "≤ 0.0001: not shown"]
    assert table.notes[0].startswith("2 stretches of 8 s for each lowered limit")
