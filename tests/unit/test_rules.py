"""Rules of the house that no linter knows."""

import ast
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src/uavrt"
OWN_ARITHMETIC = ("simulation", "units.py", "dialect")
"""The truth shares no code with what is tested by it."""
NOT_NANOSECONDS = {
    "cli/attach.py",  # the most that clocks may be apart
    "config/settings.py",  # hertz, as are the next two
    "config/tag_rules.py",
    "radio/live_source.py",
    "ground/api_extra.py",  # any number that is not absurd
    "ground/fetch.py",  # gigabytes
    "experiments/detection/rising.py",  # seconds: never
}
TYPED = (
    "detection",
    "dsp",
    "ipc",
    "localization",
    "planning",
    "pose",
    "processes",
    "radio",
    "tunnel",
)
"""Packages in which a record is a dataclass."""


def modules() -> Iterator[tuple[str, ast.Module]]:
    for path in sorted(SOURCE.rglob("*.py")):
        name = path.relative_to(SOURCE).as_posix()
        if not set(OWN_ARITHMETIC) & set(Path(name).parts):
            yield name, ast.parse(path.read_text())


def test_angles_are_wrapped_in_units_alone() -> None:
    found = [
        f"{name}:{node.lineno}"
        for name, tree in modules()
        for node in ast.walk(tree)
        if isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.Mod)
        and isinstance(node.right, ast.Constant)
        and node.right.value == 360
    ]
    assert not found, "use wrap_degrees_360 or wrap_degrees_180 of uavrt.units"


def test_seconds_become_nanoseconds_by_units_alone() -> None:
    found = {
        f"{name}:{node.lineno}"
        for name, tree in modules()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and node.value == 1e9
        and name not in NOT_NANOSECONDS
    }
    assert not found, "use ns_from_s, s_from_ns or NANOSECONDS_PER_SECOND of uavrt.units"


def test_records_of_the_inner_packages_are_no_dictionaries() -> None:
    found = [
        f"{name}:{node.lineno}"
        for name, tree in modules()
        if name.split("/")[0] in TYPED
        for node in ast.walk(tree)
        if isinstance(node, ast.Subscript) and ast.unparse(node) == "dict[str, Any]"
    ]
    assert not found, "make a frozen dataclass of it"


def test_nothing_is_cited_that_a_reader_cannot_open() -> None:
    root = SOURCE.parents[1]
    files = [
        path
        for folder in ("src", "docs", "tests")
        for path in (root / folder).rglob("*")
        if path.suffix in (".py", ".md", ".xml", ".toml") and "_build" not in path.parts
    ]
    pages = ("detector", "control", "localization", "mavlink", "perf", "style", "ros2", "weak")
    names = (*(f"reference/{page}.md §" for page in pages), "DESIGN" + ".md")
    found = [
        f"{path.relative_to(root)}: {name}"
        for path in files
        if path != Path(__file__)
        for name in names
        if name in path.read_text(encoding="utf-8")
    ]
    assert not found
