"""Areas that a map says to be empty are so as often as it says; the command has more."""

import json
from pathlib import Path

import pytest
from depth import count

from uavrt.core.errors import FormatError, UsageError
from uavrt_experiments.commands.coverage import coverage
from uavrt_experiments.coverage.absence import SILENCES, seek_tags, silence_rows
from uavrt_experiments.kept import KeptOutcomes

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("which", "silent"), [(0, 16), (1, count(4, 8))], ids=["groups", "whole flights"]
)
def test_areas_said_to_be_empty_are_so_as_often_as_it_is_said(which: int, silent: int) -> None:
    kept = KeptOutcomes()
    seek_tags(SILENCES[which], silent, kept=kept, flights=1, seed=3)
    (row,) = silence_rows(SILENCES[which], kept)
    assert row.n == silent
    assert not row.contradicted
    assert row.figure > 0.85


def test_a_stopped_run_prints_what_there_is_and_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "runs.jsonl"
    asked = {"worlds": 1, "seed": 3, "only": "C1", "json_summary": True}
    taken = KeptOutcomes.take

    def until(self: KeptOutcomes, name: str, trial: object) -> object:
        if name == "C1 0 4":
            raise KeyboardInterrupt
        return taken(self, name, trial)  # type: ignore[arg-type]

    monkeypatch.setattr(KeptOutcomes, "take", until)
    with pytest.raises(SystemExit) as ended:
        coverage(tags=6, kept=path, **asked)  # type: ignore[arg-type]
    assert ended.value.code == 130
    told = capsys.readouterr()
    assert "repeat it to go on" in told.err
    (row,) = json.loads(told.out)
    assert 0 < row["n"] < 6
    monkeypatch.setattr(KeptOutcomes, "take", taken)
    with path.open("ab") as file:
        file.write(b'{"trial": "C1 0 4", "outc')  # what a crash leaves
    at_once = []
    for kept in (path, None):
        with pytest.raises(SystemExit):
            coverage(tags=6, kept=kept, **asked)  # type: ignore[arg-type]
        at_once.append(json.loads(capsys.readouterr().out))
    assert at_once[0] == at_once[1]
    assert at_once[0][0]["n"] == 6
    # Every line is of a trial of its own: those of the first run were not made again.
    names = [json.loads(line).get("trial") for line in path.read_text().splitlines()]
    assert len(names) == len(set(names))


def test_outcomes_of_another_seed_or_of_another_kind_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "runs.jsonl"
    with KeptOutcomes(path, made_with="seed 1") as kept:
        kept.take("C1 0 0", lambda: True)
    with pytest.raises(UsageError, match=r"with seed 1, and this is seed 2.*another place"):
        KeptOutcomes(path, made_with="seed 2")
    path.write_text('{"latitude": 3}\n', "utf-8")
    with pytest.raises(FormatError, match="does not hold outcomes"):
        KeptOutcomes(path, made_with="seed 1")


def test_an_unknown_part_is_named() -> None:
    with pytest.raises(UsageError, match="no experiment C9"):
        coverage(only="C9")
