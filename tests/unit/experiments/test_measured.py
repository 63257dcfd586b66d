"""Tables of results are of the code as it is, or say that they are not."""

import shutil
from pathlib import Path

import pytest

from uavrt_experiments import measured
from uavrt_experiments.detection import EXPERIMENTS
from uavrt_experiments.detection.tables import FOLDERS, read_results, write_results
from uavrt_experiments.measured import (
    ROOT,
    SOURCE,
    digest,
    enter,
    main,
    read_parts,
    report,
)


def test_every_table_is_of_the_code_as_it_is_or_says_that_it_is_not() -> None:
    changed = [part for part in read_parts() if part.state == "changed"]
    assert not changed, report(changed)


def test_every_table_of_bars_names_the_code_that_it_was_measured_with() -> None:
    parts = {part.name: part for part in read_parts()}
    table = read_results(ROOT / "docs/images/detection/results.json")
    assert {row.experiment for row in table.rows} <= set(parts)
    assert {"localization", "capacity", "bench chain", "bench link"} <= set(parts)
    for name in table.origins:
        assert set(parts[name].folders) == set(FOLDERS)
        assert name in EXPERIMENTS


CODE = '''"""A module."""

LIMIT = 2.0
"""What it is."""


def twice(value: float) -> float:
    """Get twice a value."""
    return LIMIT * value
'''


@pytest.fixture
def source(tmp_path: Path) -> Path:
    (tmp_path / "dsp").mkdir()
    (tmp_path / "dsp" / "twice.py").write_text(CODE, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("old", "new", "counts"),
    [
        ('"""Get twice a value."""', '"""Get the double."""', False),
        ('"""What it is."""', "", False),
        ("    return LIMIT * value", "    # Twice.\n    return (\n  LIMIT*value)", False),
        ("2.0", "2.5", True),
        ("LIMIT * value", "value * LIMIT", True),
        ("twice", "double", True),
    ],
)
def test_only_code_counts(source: Path, old: str, new: str, counts: bool) -> None:
    before = digest(["dsp"], source)
    (source / "dsp" / "twice.py").write_text(CODE.replace(old, new), encoding="utf-8")
    assert (digest(["dsp"], source) != before) is counts


def test_a_file_that_moves_or_comes_counts(source: Path) -> None:
    before = digest(["dsp"], source)
    (source / "dsp" / "empty.py").write_text("", encoding="utf-8")
    added = digest(["dsp"], source)
    (source / "dsp" / "empty.py").unlink()
    (source / "dsp" / "twice.py").rename(source / "dsp" / "two.py")
    assert len({before, added, digest(["dsp"], source)}) == 3


@pytest.mark.parametrize(
    ("old", "new", "counts"),
    [("/* Twice. */", "/* Doubled. */ // here", False), ("2.0f", "2.5f", True)],
)
def test_the_kernels_count_with_the_detector(
    source: Path, tmp_path: Path, old: str, new: str, counts: bool
) -> None:
    native = tmp_path / "native"
    native.mkdir()
    code = (
        '#include "common.h"\n/* Twice. */\nfloat twice(float x)\n{\n    return 2.0f * x;\n}\n'
    )
    (native / "twice.h").write_text(code, encoding="utf-8")
    before, other = digest(["dsp"], source, native), digest(["tunnel"], source, native)
    (native / "twice.h").write_text(code.replace(old, new), encoding="utf-8")
    assert (digest(["dsp"], source, native) != before) is counts
    assert digest(["tunnel"], source, native) == other


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Tables of this repository, and a copy of the code that may be changed."""
    for folder in (*FOLDERS, "localization", "tunnel", "mavlink"):
        shutil.copytree(SOURCE / folder, tmp_path / "source" / folder)
    (tmp_path / "docs" / "images").mkdir(parents=True)
    shutil.copytree(ROOT / "docs/images/detection", tmp_path / "docs/images/detection")
    original = digest
    monkeypatch.setattr(measured, "digest", lambda names: original(names, tmp_path / "source"))
    monkeypatch.setattr(
        measured, "read_parts", lambda root=tmp_path, read=read_parts: read(root)
    )
    monkeypatch.setattr(measured, "enter", lambda p, line, put=enter: put(p, line, tmp_path))
    table = read_results(tmp_path / "docs/images/detection/results.json")
    fresh = measured.measured_now(FOLDERS)
    for origin in table.origins.values():
        object.__setattr__(origin, "measured", fresh)
        object.__setattr__(origin, "notes", ())
    write_results(tmp_path / "docs/images/detection", table)
    return tmp_path


def test_a_change_is_told_with_what_to_run_until_it_is_entered(
    clone: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["show"]) == 0
    code = clone / "source" / "dsp" / "changed.py"
    code.write_text("x = 1\n", encoding="utf-8")
    assert main(["show"]) == 1
    told = capsys.readouterr().out
    assert "uavrt experiment detection --only E3 --trials 200 --output-dir docs/images" in told
    assert main(["enter", "E3", "a module that nothing imports"]) == 0
    assert main(["again", "E4", "the follower changed"]) == 0
    states = {part.name: part.state for part in measured.read_parts()}
    assert states["E3"] == "entered"
    assert states["E4"] == "to be measured again"
    assert states["E5"] == "changed"
    # A table that is written again, as by a campaign of another part, keeps what was entered.
    where = clone / "docs/images/detection"
    before = (where / "results.md").read_text(encoding="utf-8")
    write_results(where, read_results(where / "results.json"))
    assert (where / "results.md").read_text(encoding="utf-8") == before
    # The next change is one more.
    code.write_text("x = 2\n", encoding="utf-8")
    assert {p.name: p.state for p in measured.read_parts()}["E3"] == "changed"
    assert main(["enter", "all changed", "as before"]) == 0
    assert main(["show"]) == 0


def test_a_reason_is_one_line_and_a_part_is_one_of_the_tables(clone: Path) -> None:
    for parts, reason in (("E3", "two\nlines"), ("E3", " "), ("E99", "why")):
        with pytest.raises(SystemExit):
            main(["enter", parts, reason])
