"""Rules of the house that no linter knows."""

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from itertools import chain
from pathlib import Path

from uavrt.drone.supervisor.tree.process_shapes import SHAPES

SOURCE = Path(__file__).parents[2] / "src/uavrt"
OWN_ARITHMETIC = ("simulation", "units.py", "dialect")
"""The truth shares no code with what is tested by it."""
NOT_NANOSECONDS = {
    "cli/options/kinds.py",  # the most that clocks may be apart
    "config/settings.py",  # hertz, as are the next two
    "config/tags/tag_rules.py",
    "radio/live_source.py",
    "ground/web/routes/drone_flights.py",  # any number that is not absurd
    "ground/fetch/ftp_client.py",  # gigabytes
    "uavrt_experiments/archive_sum.py",  # gigabytes
    "uavrt_experiments/detection/rising.py",  # seconds: never
}
TYPED = (
    "detection",
    "dsp",
    "drone/ipc",
    "localization",
    "planning",
    "drone/processes",
    "radio",
    "link/tunnel",
)
"""Packages in which a record is a dataclass."""

NUMBERS = {
    "detection": 12,
    "localization": 6,
    "planning": 4,
    "guidance": 15,
}
"""Most numbers in modules and classes that are no frozen record; fewer is better."""
TUNED = 118
"""Most tuned numbers of localization and whole flights; fewer is better."""
KINDS = ("Guard[", "Resolution[", "Fixed[")
NEUTRAL = {"0", "0.0", "1", "((1.0, 0.0, 0.0),)"}
"""Values that stand for nothing: no error, one of a kind, one case without an error."""
GUARDS_OF_PARTS = {"limits"}
"""Fields of kind `Guard` in a record that is part of another, as of `LastingError`."""
AMBIGUOUS = 0
"""Most names that stand for different numbers in them; fewer is better."""
NOT_COUNTED = (
    "guidance/files/mission.py",
    "guidance/files/plan_file.py",
    "localization/pose/",
    "localization/terrain/",
)
"""Modules whose numbers are those of MAVLink, of QGroundControl's plans, of mounting and of
elevation files."""
LINES_OF_A_CLASS = 250
LARGER_CLASSES = {
    "Track": 396,
    "Refiner": 351,
    "Component": 325,
    "FakeAutopilot": 335,
    "Supervisor": 347,
    "FileServer": 340,
    "Guide": 332,
    "ProcessTree": 331,
    "CodedDetector": 325,
    "Participant": 319,
    "PulseDetector": 311,
    "Recorder": 303,
    "LossFinder": 285,
    "SurveyEvidence": 266,
    "TimeKeeper": 262,
}
"""Lines of the classes that exceed the limit: none may grow, and there may be no others."""


@cache
def texts() -> dict[str, str]:
    """Modules of the product and its experiments, by name."""
    experiments = SOURCE.parents[1] / "claims/uavrt_experiments"
    named = {
        path.relative_to(
            SOURCE if SOURCE in path.parents else experiments.parent
        ).as_posix(): path.read_text()
        for path in sorted([*SOURCE.rglob("*.py"), *experiments.rglob("*.py")])
    }
    own = set(OWN_ARITHMETIC)
    return {name: text for name, text in named.items() if not own & set(Path(name).parts)}


def nodes(pattern: str) -> Iterator[tuple[str, ast.AST]]:
    """Syntax of all modules in whose text a pattern stands; to parse all takes seconds."""
    for name, text in texts().items():
        if re.search(pattern, text):
            for node in ast.walk(ast.parse(text)):
                yield name, node


def test_no_class_grows_beyond_what_one_reads_in_a_sitting() -> None:
    grown = [
        f"{path}: {found[1]}"
        for path in SOURCE.rglob("*.py")
        for found in re.finditer(r"(?m)^class (\w+)[^:]*:\n(?: .*\n|\n)*", path.read_text())
        if found[0].rstrip().count("\n") >= LARGER_CLASSES.get(found[1], LINES_OF_A_CLASS)
    ]
    assert not grown, "split it: a part holds one idea, and writes its own attributes only"


def test_angles_are_wrapped_in_units_alone() -> None:
    found = [
        f"{name}:{node.lineno}"
        for name, node in nodes(r"%=?\s*360")
        if isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.Mod)
        and isinstance(node.right, ast.Constant)
        and node.right.value == 360
    ]
    assert not found, "use wrap_degrees_360 or wrap_degrees_180 of uavrt.core.units"


def test_seconds_become_nanoseconds_by_units_alone() -> None:
    found = {
        f"{name}:{node.lineno}"
        for name, node in nodes(r"(?i)1\.?0*e\+?0*9|1(_?0){9}")
        if isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and node.value == 1e9
        and name not in NOT_NANOSECONDS
    }
    assert not found, "use ns_from_s, s_from_ns or NANOSECONDS_PER_SECOND of uavrt.core.units"


def test_records_of_the_inner_packages_are_no_dictionaries() -> None:
    found = [
        f"{name}:{node.lineno}"
        for name, node in nodes(r"dict\[\s*str\s*,\s*Any")
        if name.startswith(tuple(f"{package}/" for package in TYPED))
        and isinstance(node, ast.Subscript)
        and ast.unparse(node) == "dict[str, Any]"
    ]
    assert not found, "make a frozen dataclass of it"


def test_what_a_function_returns_is_described_in_one_place() -> None:
    found = [
        f"{name}:{node.lineno}"
        for name, node in nodes(r"(?s)Returns: .*Returns: ")
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value.count("\n    Returns: ") + node.value.count("\n        Returns: ") > 1
    ]
    assert not found, "write Returns (one, other): what one is; what the other is."


def test_nothing_is_cited_that_a_reader_cannot_open() -> None:
    root = SOURCE.parents[1]
    files = [
        path
        for folder in ("src", "claims", "docs", "tests")
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
    processes = {module for module in rows if module.startswith("uavrt.drone.processes.")}
    made_of_others = {"uavrt.drone.processes.chain"}
    assert set(independent["modules"]) == processes - made_of_others


def numbers_in(body: list[ast.stmt]) -> Iterator[tuple[str, str]]:
    """Names that are set to numbers alone, and the numbers; not in classes with decorators."""
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.decorator_list:
            yield from numbers_in(node.body)
        elif isinstance(node, ast.Assign | ast.AnnAssign) and is_number(node.value):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            for name in target.elts if isinstance(target, ast.Tuple) else [target]:
                yield ast.unparse(name), ast.unparse(node.value or name)


def is_number(value: ast.expr | None) -> bool:
    nodes = [] if value is None else list(ast.walk(value))
    types = {type(node.value) for node in nodes if isinstance(node, ast.Constant)}
    names = {node.id for node in nodes if isinstance(node, ast.Name)}
    return bool(types) and names <= {"np", "math"} and types <= {int, float}


def numbers_of(package: str) -> list[tuple[str, str]]:
    return [
        number
        for path in sorted((SOURCE / package).rglob("*.py"))
        if not path.relative_to(SOURCE).as_posix().startswith(NOT_COUNTED)
        for number in numbers_in(ast.parse(path.read_text()).body)
    ]


def test_numbers_stand_in_frozen_records() -> None:
    found = {package: len(numbers_of(package)) for package in NUMBERS}
    assert all(found[package] <= most for package, most in NUMBERS.items()), found


def tuned_in(tree: ast.Module) -> Iterator[str]:
    """Fields and options of a module that are set to numbers which no kind excuses.

    A record within a record counts by its numbers.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            for field in node.body:
                if isinstance(field, ast.AnnAssign):
                    yield from tuned_as(field.target, field.annotation, field.value)
        elif isinstance(node, ast.FunctionDef):
            given = node.args
            usual = list(zip(given.args[::-1], given.defaults[::-1], strict=False))
            for arg, value in usual[::-1] + list(
                zip(given.kwonlyargs, given.kw_defaults, strict=True)
            ):
                yield from tuned_as(ast.Name(arg.arg), arg.annotation, value)


def tuned_as(
    name: ast.expr, annotation: ast.expr | None, value: ast.expr | None
) -> Iterator[str]:
    if annotation and ast.unparse(annotation).startswith(KINDS):
        return
    if isinstance(value, ast.Call):
        for part in value.keywords:
            if part.arg not in GUARDS_OF_PARTS:
                whole = ast.Name(f"{ast.unparse(name)}.{part.arg}")
                yield from tuned_as(whole, None, part.value)
    elif value and is_number(value) and ast.unparse(value) not in NEUTRAL:
        yield ast.unparse(name)


def test_few_numbers_of_localization_are_tuned() -> None:
    found = [
        f"{path.relative_to(SOURCE)}: {name}"
        for path in sorted((SOURCE / "localization").rglob("*.py"))
        if not path.relative_to(SOURCE).as_posix().startswith(NOT_COUNTED)
        for name in tuned_in(ast.parse(path.read_text()))
    ]
    assert len(found) <= TUNED, found


def test_what_counts_as_tuned() -> None:
    text = (
        "class A:\n    a: Guard[float] = 3.0\n    b: float = 2.0\n    c: float = 0.0\n"
        "    d: B = B(e=2.0, f=0.0)\ndef g(h, i=2.0, *, j=0.0, k=(2, 3)):\n    pass\n"
    )
    assert list(tuned_in(ast.parse(text))) == ["b", "d.e", "i", "k"]


def test_a_name_stands_for_one_number() -> None:
    values: dict[str, set[str]] = {}
    for name, value in chain.from_iterable(map(numbers_of, NUMBERS)):
        values.setdefault(name, set()).add(value)
    several = [name for name, some in values.items() if len(some) > 1]
    assert len(several) <= AMBIGUOUS, several


def test_what_counts_as_a_number() -> None:
    text = "A, B = 1.0, -2\nC: T = np.log(np.array([2.0]))\nD = A * 2.0\nclass E:\n    F = 3\n"
    assert [name for name, _ in numbers_in(ast.parse(text).body)] == ["A", "B", "C", "F"]
