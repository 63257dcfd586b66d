"""`uavrt experiment detection` in a reduced, seeded form: no bar is contradicted.

One of four or seven cases of each experiment runs in `make test`, all of them in `make claims`.
"""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from depth import share

from uavrt import __version__
from uavrt.core.errors import ConfigError, UsageError
from uavrt_experiments.commands.detection import detection
from uavrt_experiments.detection import original, theory
from uavrt_experiments.detection.campaign import short_rows
from uavrt_experiments.detection.catalogue import EXPERIMENTS
from uavrt_experiments.detection.false_alarms import FalseAlarms, false_alarm_row
from uavrt_experiments.detection.tables import read_results
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import (
    count_interval,
    level_for,
    poisson_interval,
    quantile,
    rms,
    share_by_flight,
    wilson_interval,
)
from uavrt_experiments.tables import bars_kept

pytestmark = pytest.mark.slow

UNBARRED = {
    ("E2", "fading"),
    ("E2", "ramp"),
    ("E12", "0 to +20 dB, 50 Hz away, same interval"),
    ("E12", "+40 dB, 500 Hz away, same interval"),
    ("E16", "10 dB, silent for 10 s"),
}
"""Cases of which nothing is asked: shown beside the others."""
TIMED = {
    (name, case.name)
    for name in ("E16", "E23")
    for case in EXPERIMENTS[name].cases
    if case.alone
}
"""CPU time means something on a quiet machine only, not in a test."""
EVERY = {
    (experiment.name, case.name): case
    for experiment in EXPERIMENTS.values()
    for case in experiment.cases
    if (experiment.name, case.name) not in UNBARRED | TIMED
}
UNSAID = [one for one in EVERY if one[1].startswith(("times, ", "recall, "))]
"""Streams with losses that nobody tells: they try the radio's times, no detector."""
CASES = {one: case for one, case in EVERY.items() if one not in UNSAID}
BY_EXPERIMENT = [[one for one in CASES if one[0] == name] for name in EXPERIMENTS]
SHORT = [one for cases in BY_EXPERIMENT for one in share(cases, 4 if len(cases) < 9 else 7)]
"""Cases often come in threes of one kind: the fourth and the seventh are of other kinds."""


def missed(rows: list[Row]) -> list[Row]:
    """Rows whose bar is missed grossly."""
    return [row for row in rows if row.contradicted]


@pytest.mark.parametrize("which", SHORT + share(UNSAID, 3), ids=" ".join)
def test_no_bar_is_contradicted(which: tuple[str, str]) -> None:
    rows = short_rows(EVERY[which], 11)
    assert any(row.barred for row in rows)
    assert not missed(rows)


def test_misses_alone_tell_that_the_level_lies_above_what_was_tried() -> None:
    level, low, high, _ = level_for([(1.0, 0, 20), (2.0, 0, 20)], 0.5)
    assert level >= low == pytest.approx(2.0)
    assert high == math.inf
    level, low, high, _ = level_for([(1.0, 20, 20), (2.0, 20, 20)], 0.5)
    assert level <= high == pytest.approx(1.0)
    assert low == -math.inf


def test_two_levels_that_are_found_alike_do_not_lead_to_a_level_far_from_all() -> None:
    """It was -377 dB, of the two lowest alone, and its bar was met."""
    points = [(2.2, 9, 15), (2.95, 9, 15), (3.7, 13, 15), (4.45, 15, 15)]
    level, low, high, error = level_for(points, 0.5)
    assert max(low, 1.0) < level < min(high, 2.5)
    assert error < 1.0


def test_a_tag_that_was_followed_below_all_levels_has_none_among_them() -> None:
    """One level that stands out sent the fit to 8.9 dB, where .97 were found, or to -0.1."""
    found = [10, 39, 27, 40, 39, 39, 36, *[40] * 11, 15]
    tried = [19, 40, 40, 41, 40, 41, 39, *[41] * 11, 21]
    levels = 5.0 + 0.5 * np.arange(len(found))
    level, low, high, _ = level_for(list(zip(levels.tolist(), found, tried, strict=True)), 0.5)
    assert low < level < high < 5.0


def test_every_acceptance_experiment_is_there_with_a_bar_in_each() -> None:
    assert {f"E{n}" for n in (*range(1, 14), 16, 17, 18, 21, 22, 23)} == set(EXPERIMENTS)
    names = [(e.name, case.name) for e in EXPERIMENTS.values() for case in e.cases]
    assert len(set(names)) == len(names)
    assert set(names) >= UNBARRED
    assert {experiment for experiment, _ in CASES} == set(EXPERIMENTS)


@pytest.mark.parametrize("which", sorted(UNBARRED), ids=" ".join)
def test_what_has_no_short_form_has_no_bar(which: tuple[str, str]) -> None:
    case = next(c for c in EXPERIMENTS[which[0]].cases if c.name == which[1])
    brief = case.short or case
    assert not any(
        row.barred for row in brief.rows([brief.trial(np.random.default_rng(11), 0)])
    )


@pytest.fixture
def only_one_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    full = EXPERIMENTS["E2"]
    curve = replace(full.cases[0], least=22)
    monkeypatch.setitem(EXPERIMENTS, "E2", replace(full, cases=(curve,)))


@pytest.mark.usefixtures("only_one_curve")
def test_the_command_writes_table_and_curve_and_keeps_earlier_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(**options: Any) -> int:
        with pytest.raises(SystemExit) as end:
            detection(only="e2", trials=1, workers=1, output_dir=tmp_path, **options)
        assert isinstance(end.value.code, int)
        return end.value.code

    assert run() == 0
    shown = capsys.readouterr().out
    assert "E2: Pd of single decisions" in shown
    assert "requirements met" in shown
    assert (tmp_path / "pd.png").read_bytes().startswith(b"\x89PNG")
    first = read_results(tmp_path / "results.json")
    assert {row.experiment for row in first.rows} == {"E2"}
    assert first.origins["E2"].version.startswith(__version__)
    assert f"| {first.rows[0].quantity} | {first.rows[0].case} |" in (
        tmp_path / "results.md"
    ).read_text(encoding="utf-8")
    other = replace(first.rows[0], experiment="E8", case="of an earlier run")
    kept = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    kept["rows"].append({**kept["rows"][0], "experiment": "E8", "case": other.case})
    kept["origins"]["E8"] = kept["origins"]["E2"]
    (tmp_path / "results.json").write_text(json.dumps(kept), encoding="utf-8")
    run(seed=2, plots=False, json_summary=True)
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert {row["experiment"] for row in told["rows"]} == {"E2"}
    assert told["rows"][0]["verdict"]
    again = read_results(tmp_path / "results.json")
    assert other in again.rows
    assert again.origins["E2"].seed == 2
    assert again.origins["E8"].seed == 1


def test_single_cases_are_shown_and_not_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "table"
    with pytest.raises(SystemExit):
        detection(only="E3", case="K = 1, false", trials=1, workers=1, output_dir=folder)
    shown = capsys.readouterr().out
    assert "K = 1, whole channel, nominal 5 %" in shown
    assert "K = 2" not in shown
    assert "Written" not in shown
    assert not folder.exists()
    with pytest.raises(UsageError, match=r'"nobody" in its name.* K = 1; K = 2'):
        detection(only="E3", case="nobody", output_dir=folder)


def test_an_experiment_that_is_not_there_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="E99"):
        detection(only="E2,E99", output_dir=tmp_path)


def test_a_file_that_holds_no_results_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    path.write_text('{"rows": [{}]}', encoding="utf-8")
    with pytest.raises(ConfigError, match="no results"):
        detection(only="E2", output_dir=tmp_path, plots=False)
    assert path.read_text(encoding="utf-8") == '{"rows": [{}]}'


def row(
    figure: float,
    low: float,
    high: float,
    *,
    least: float | None = None,
    most: float | None = None,
) -> Row:
    interval: dict[str, Any] = {"figure": figure, "low": low, "high": high}
    return Row(experiment="E2", quantity="", case="", n=1, least=least, most=most, **interval)


@pytest.mark.parametrize(
    ("made", "verdict"),
    [
        (row(0.9, 0.8, 0.95, least=0.7), "met"),
        (row(0.9, 0.6, 0.95, least=0.7), "met, within error"),
        (row(0.6, 0.5, 0.8, least=0.7), "not met, within error"),
        (row(0.6, 0.5, 0.65, least=0.7), "NOT met"),
        (row(1.5, 1.45, 1.6, least=0.7, most=1.4), "NOT met"),
        (row(0.0, 0.0, 3.7, most=0.0), "met"),
        (row(0.5, 0.1, 2.0, most=0.0), "NOT met"),
        (row(0.5, 0.1, 2.0), ""),
    ],
)
def test_the_verdict_is_the_figures_and_says_when_the_interval_disagrees(
    made: Row, verdict: str
) -> None:
    assert made.verdict == verdict
    assert bars_kept([made]).startswith(
        f"{int(made.barred and made.met)} of {int(made.barred)}"
    )


@pytest.mark.parametrize(
    ("interval", "share"),
    [
        (lambda rng: wilson_interval(int(rng.binomial(100, 0.3)), 100), 0.3),
        (lambda rng: poisson_interval(int(rng.poisson(4.0))), 4.0),
        (lambda rng: count_interval(4 * rng.poisson(2.0, 50)), 400.0),
        (lambda rng: rms(rng.normal(0.0, 2.0, 200))[1:], 2.0),
        (lambda rng: quantile(rng.exponential(1.0, 200), 0.9)[1:], math.log(10.0)),
        (lambda rng: _fitted(rng), 9.0),
    ],
    ids=["share", "count", "clusters", "rms", "quantile", "level"],
)
def test_95_percent_intervals_hold_the_truth_as_often_as_they_say(
    interval: Callable[[np.random.Generator], tuple[float, float]], share: float
) -> None:
    rng = np.random.default_rng(5)
    held = sum(low <= share <= high for low, high in (interval(rng) for _ in range(400)))
    # Chance of fewer than 365 of 400 for a true 95 %: below 0.1 %.
    assert 365 <= held <= 399


def _fitted(rng: np.random.Generator) -> tuple[float, float]:
    """Interval of the level for a half, when the curve is logistic about 9 dB."""
    points = []
    for level in (8.0, 8.5, 9.0, 9.5, 10.0):
        hits = int(rng.binomial(80, 1.0 / (1.0 + math.exp(-1.5 * (level - 9.0)))))
        points.append((level, hits, 80))
    return level_for(points, 0.5)[1:3]


def test_flights_that_differ_widen_the_interval_of_a_recall() -> None:
    share, low, high = share_by_flight([95, 94, 40, 95], [95, 95, 95, 95])
    assert share == pytest.approx(0.8526, abs=1e-3)
    narrow = wilson_interval(324, 380)
    assert low < narrow[0] < narrow[1] < high


def test_false_alarms_are_counted_against_the_nominal_number() -> None:
    counted = [FalseAlarms(intervals=84.0, groups=4, confirmed=0)] * 10
    made = false_alarm_row(counted, experiment="E1", case="", probability=0.05)
    assert made.figure == pytest.approx(40.0 / 42.0)
    assert made.met
    twice = [FalseAlarms(intervals=84.0, groups=8, confirmed=0)] * 10
    assert false_alarm_row(twice, experiment="E1", case="", probability=0.05).contradicted


def test_theory_agrees_with_the_table_of_the_reference() -> None:
    for k, level in theory.ENR_HALF_DB.items():
        assert abs(theory.union_bound(k, level) - 0.5) < 0.12
    for k, level in theory.GENIE_HALF_DB.items():
        assert theory.genie(k, level) == pytest.approx(0.5, abs=0.04)
    assert theory.erlang_tail(1, 3.0) == pytest.approx(math.exp(-3.0))
    threshold = theory.erlang_threshold(3, 1e-6)
    assert theory.erlang_tail(3, threshold) == pytest.approx(1e-6, rel=1e-6)
    noise_only = theory.detection_probability(1, -60.0, 2.0)
    assert noise_only == pytest.approx(math.exp(-2.0), rel=1e-3)
    assert theory.frequency_bound_hz(20.0, 0.02) == pytest.approx(1.95, abs=0.01)
    # The published Pd of the original lies below the bound of its own search.
    assert all(pd < theory.union_bound(3, enr) for enr, pd in original.PD.items())
