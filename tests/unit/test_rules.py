"""Rules of the house that no linter knows."""

import ast
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from uavrt.supervisor.tree.shapes import SHAPES

SOURCE = Path(__file__).parents[2] / "src/uavrt"
OWN_ARITHMETIC = ("simulation", "units.py", "dialect")
"""The truth shares no code with what is tested by it."""
NOT_NANOSECONDS = {
    "cli/kinds.py",  # the most that clocks may be apart
    "config/settings.py",  # hertz, as are the next two
    "config/tag_rules.py",
    "radio/live_source.py",
    "ground/web/drone_flights.py",  # any number that is not absurd
    "ground/fetch/ftp_client.py",  # gigabytes
    "uavrt_experiments/archive_sum.py",  # gigabytes
    "uavrt_experiments/detection/rising.py",  # seconds: never
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


LINES_OF_A_CLASS = 250
LARGER_CLASSES = {
    "Track": 400,
    "Refiner": 358,
    "FileServer": 358,
    "Component": 355,
    "Supervisor": 354,
    "FakeAutopilot": 348,
    "Guide": 333,
    "Fleet": 331,
    "CodedDetector": 329,
    "Participant": 322,
    "PulseDetector": 317,
    "LossFinder": 314,
    "Recorder": 308,
    "SurveyEvidence": 271,
    "TimeKeeper": 262,
}
"""Lines of the classes that exceed the limit: none may grow, and there may be no others."""

LOOKED_AT = (ast.BinOp, ast.ClassDef, ast.Constant, ast.Subscript, ast.ImportFrom)


@cache
def nodes_of_all() -> dict[Path, list[ast.AST]]:
    """What the rules look at, of each module."""
    experiments = SOURCE.parent / "uavrt_experiments"
    return {
        path: [
            node
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, LOOKED_AT)
        ]
        for path in sorted([*SOURCE.rglob("*.py"), *experiments.rglob("*.py")])
    }


def modules() -> Iterator[tuple[str, list[ast.AST]]]:
    for path, nodes in nodes_of_all().items():
        name = path.relative_to(SOURCE.parent).as_posix().removeprefix("uavrt/")
        if not set(OWN_ARITHMETIC) & set(Path(name).parts):
            yield name, nodes


def test_no_class_grows_beyond_what_one_reads_in_a_sitting() -> None:
    grown = [
        f"{path}: {node.name}"
        for path, nodes in nodes_of_all().items()
        for node in nodes
        if isinstance(node, ast.ClassDef)
        and SOURCE in path.parents
        and (node.end_lineno or 0) - node.lineno
        >= LARGER_CLASSES.get(node.name, LINES_OF_A_CLASS)
    ]
    assert not grown, "split it: a part holds one idea, and writes its own attributes only"


def test_angles_are_wrapped_in_units_alone() -> None:
    found = [
        f"{name}:{node.lineno}"
        for name, nodes in modules()
        for node in nodes
        if isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.Mod)
        and isinstance(node.right, ast.Constant)
        and node.right.value == 360
    ]
    assert not found, "use wrap_degrees_360 or wrap_degrees_180 of uavrt.units"


def test_seconds_become_nanoseconds_by_units_alone() -> None:
    found = {
        f"{name}:{node.lineno}"
        for name, nodes in modules()
        for node in nodes
        if isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and node.value == 1e9
        and name not in NOT_NANOSECONDS
    }
    assert not found, "use ns_from_s, s_from_ns or NANOSECONDS_PER_SECOND of uavrt.units"


def test_records_of_the_inner_packages_are_no_dictionaries() -> None:
    found = [
        f"{name}:{node.lineno}"
        for name, nodes in modules()
        if name.split("/")[0] in TYPED
        for node in nodes
        if isinstance(node, ast.Subscript) and ast.unparse(node) == "dict[str, Any]"
    ]
    assert not found, "make a frozen dataclass of it"


def test_what_a_function_returns_is_described_in_one_place() -> None:
    found = [
        f"{name}:{node.lineno}"
        for name, nodes in modules()
        for node in nodes
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value.count("\n    Returns: ") + node.value.count("\n        Returns: ") > 1
    ]
    assert not found, "write Returns (one, other): what one is; what the other is."


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


def test_the_contract_of_independence_names_every_process() -> None:
    project = tomllib.loads((SOURCE.parents[1] / "pyproject.toml").read_text())
    contracts = project["tool"]["importlinter"]["contracts"]
    (independent,) = (one for one in contracts if one["type"] == "independence")
    rows = {row.module for rows in SHAPES.values() for row in rows}
    processes = {module for module in rows if module.startswith("uavrt.processes.")}
    made_of_others = {"uavrt.processes.chain"}
    assert set(independent["modules"]) == processes - made_of_others
