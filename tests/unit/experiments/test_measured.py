"""Tables of results name the code that they were measured with."""

from pathlib import Path

import pytest

from uavrt_experiments.detection.catalogue import EXPERIMENTS
from uavrt_experiments.detection.tables import FOLDERS, read_results
from uavrt_experiments.measured import ROOT, digest, read_parts


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
