"""Seeded faults in the product, to show that a change of the tests lost nothing.

``python tests/faults.py choose COVERAGE`` picks forty faults that the tests catch: four in each
of ten packages, one of each kind. ``COVERAGE`` is a data file written with
``pytest --cov=uavrt --cov-context=test``; for each fault only tests that execute its line run.
``python tests/faults.py check`` puts the forty in again, one at a time, and prints which tests
catch each. A fault is put into a copy of the source, never into the source itself.
"""

import argparse
import ast
import copy
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
CHOSEN = Path(__file__).with_suffix(".json")
PACKAGES = (
    "detection",
    "dsp",
    "ground",
    "guidance",
    "localization/whole_flight",
    "localization",
    "link/mavlink",
    "planning",
    "flight",
    "link/tunnel",
)
MOST_TESTS = 12
"""Tests that are tried for a fault while the forty are chosen."""
LIMIT_S = 240.0
"""A run that takes longer counts as a catch: the fault made it hang."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One expression or statement of the source, and what takes its place."""

    package: str
    kind: str
    path: str
    """Below ``src/uavrt``."""
    function: str
    line: int
    """Number in the source that the fault was chosen in; only the nearest match counts."""
    before: str
    after: str
    caught_by: str = ""
    """Test that failed when the fault was chosen."""
    tests: tuple[str, ...] = field(default_factory=tuple)
    """Other tests that execute the line."""


# ------------------------------------------------------------------ kinds of faults

OPPOSITE: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}


def constant(node: ast.AST) -> ast.AST | None:
    """Another number."""
    if not isinstance(node, ast.Constant) or type(node.value) not in (int, float):
        return None
    number: Any = node.value
    return ast.Constant(number + 1 if isinstance(number, int) else number * 1.5 + 0.5)


def comparison(node: ast.AST) -> ast.AST | None:
    """The opposite comparison."""
    if not isinstance(node, ast.Compare) or type(node.ops[0]) not in OPPOSITE:
        return None
    changed = copy.deepcopy(node)
    changed.ops[0] = OPPOSITE[type(node.ops[0])]()
    return changed


def dropped_call(node: ast.AST) -> ast.AST | None:
    """Nothing, where a function was called for its effect."""
    is_call = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    return ast.Pass() if is_call else None


def sign(node: ast.AST) -> ast.AST | None:
    """A difference in place of a sum, or the reverse."""
    if not isinstance(node, ast.BinOp) or not isinstance(node.op, ast.Add | ast.Sub):
        return None
    changed = copy.deepcopy(node)
    changed.op = ast.Sub() if isinstance(node.op, ast.Add) else ast.Add()
    return changed


KINDS: dict[str, Callable[[ast.AST], ast.AST | None]] = {
    "constant": constant,
    "comparison": comparison,
    "dropped call": dropped_call,
    "sign": sign,
}


def functions(text: str) -> Iterator[tuple[str, ast.AST]]:
    """Each function of a module with its name."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, node


def places(text: str, kind: str) -> Iterator[tuple[str, ast.AST, ast.AST]]:
    """Function, node and changed node of each fault of a kind that a module could have."""
    for name, function in functions(text):
        for node in ast.walk(function):
            changed = KINDS[kind](node)
            if changed is not None:
                yield name, node, changed


def faults_of(package: str, kind: str) -> list[Fault]:
    """Every fault of a kind that a package could have."""
    source = ROOT / "src/uavrt"
    found = []
    for path in sorted((source / package).rglob("*.py")):
        if "dialect" in path.parts:
            continue  # generated
        text = path.read_text("utf-8")
        for function, node, changed in places(text, kind):
            before = ast.get_source_segment(text, node) or ""
            after = ast.unparse(changed)
            if before != after:
                name = path.relative_to(source).as_posix()
                found.append(
                    Fault(package, kind, name, function, node.lineno, before, after)  # type: ignore[attr-defined]
                )
    return found


def with_fault(fault: Fault, text: str) -> str | None:
    """Text of the module with the fault; None where its place is gone."""
    nodes = [
        node
        for function, node, changed in places(text, fault.kind)
        if function == fault.function
        and ast.get_source_segment(text, node) == fault.before
        and ast.unparse(changed) == fault.after
    ]
    if not nodes:
        return None
    node: Any = min(nodes, key=lambda one: abs(one.lineno - fault.line))  # type: ignore[attr-defined]
    lines = text.encode().splitlines(keepends=True)
    begin = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
    end = sum(map(len, lines[: node.end_lineno - 1])) + node.end_col_offset
    after = fault.after if fault.kind in ("dropped call", "constant") else f"({fault.after})"
    whole = text.encode()
    return (whole[:begin] + after.encode() + whole[end:]).decode()


# ------------------------------------------------------------------ running tests


class Source:
    """A copy of ``src`` in which one fault at a time stands."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory / "src"
        shutil.copytree(ROOT / "src", self._directory)

    def catches(self, fault: Fault, *selection: str) -> str | None:
        """Name of a test among `selection` that fails with the fault."""
        path = self._directory / "uavrt" / fault.path
        text = path.read_text("utf-8")
        changed = with_fault(fault, text)
        assert changed is not None, f"{fault.path}: {fault.before} is gone"
        path.write_text(changed, "utf-8")
        try:
            return self._first_failure(*selection)
        finally:
            path.write_text(text, "utf-8")

    def _first_failure(self, *selection: str) -> str | None:
        command = [sys.executable, "-m", "pytest", "-x", "-n0", "-p", "no:cacheprovider"]
        environment = {
            "PYTHONPATH": str(self._directory),
            "PYTHONDONTWRITEBYTECODE": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
        try:
            done = subprocess.run(
                [*command, "--tb=no", "-rfE", *selection],
                cwd=ROOT,
                env=os.environ | environment,
                capture_output=True,
                text=True,
                check=False,
                timeout=LIMIT_S,
            )
        except subprocess.TimeoutExpired:
            return f"{selection[0]} (hangs)"
        gone = set(re.findall(r"^ERROR: not found: (\S.*)$", done.stderr + done.stdout, re.M))
        if gone:  # of cases that are no more, all of the function's are tried
            others = {
                _function(one) if any(path.endswith(_function(one)) for path in gone) else one
                for one in selection
            }
            return self._first_failure(*others) if others != {*selection} else None
        failed = re.search(r"^(?:FAILED|ERROR) (\S.*?)(?: - |$)", done.stdout, re.M)
        if failed:
            return failed[1]
        return None if done.returncode in (0, 5) else f"{selection[0]} (exit {done.returncode})"


def _function(test: str) -> str:
    return test.partition("[")[0]


def tests_of_lines(coverage_file: Path) -> Callable[[str, int], list[str]]:
    """What executes a line, as a function of the module below ``src/uavrt`` and the line."""
    from coverage import CoverageData

    data = CoverageData(str(coverage_file))
    data.read()
    files = {name.rpartition("src/uavrt/")[2]: name for name in data.measured_files()}

    def tests(path: str, line: int) -> list[str]:
        if path not in files:
            return []
        contexts = data.contexts_by_lineno(files[path]).get(line, [])
        return sorted({one.partition("|")[0] for one in contexts if "|run" in one})

    return tests


def choose(coverage_file: Path, seed: int) -> None:
    """Pick faults that the tests catch, and write them down as they are found."""
    tests_of = tests_of_lines(coverage_file)
    chosen: list[Fault] = []
    if CHOSEN.exists():
        chosen = [Fault(**one) for one in json.loads(CHOSEN.read_text())]
    with tempfile.TemporaryDirectory() as directory:
        source = Source(Path(directory))
        for package in PACKAGES:
            for kind in KINDS:
                if any((one.package, one.kind) == (package, kind) for one in chosen):
                    continue
                rng = random.Random(f"{seed} {package} {kind}")
                candidates = faults_of(package, kind)
                rng.shuffle(candidates)
                for fault in candidates:
                    tests = tests_of(fault.path, fault.line)
                    if not tests:
                        continue
                    tried = rng.sample(tests, min(MOST_TESTS, len(tests)))
                    caught = source.catches(fault, *tried)
                    print(f"{package}, {kind}: {fault.path}:{fault.line} {caught}", flush=True)
                    if caught:
                        values = asdict(fault) | {"caught_by": caught, "tests": tests[:8]}
                        chosen.append(Fault(**values))
                        text = json.dumps([asdict(one) for one in chosen], indent=1)
                        CHOSEN.write_text(text + "\n")
                        break


def present(test: str) -> str | None:
    """Where a test of that file and name stands now."""
    path, _, name = test.partition("::")
    function = re.split(r"[\[:]", name.rpartition("::")[2] or name)[0]
    pattern = re.compile(rf"def {re.escape(function)}\(")
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    files.sort(key=lambda one: one.name != Path(path).name)  # stable: same name first
    for file in files:
        if pattern.search(file.read_text("utf-8")):
            found = file.relative_to(ROOT).as_posix()
            return f"{found}::{name}" if file.name == Path(path).name else found
    return None


def check(quick: bool) -> int:
    """Put each fault in again; the number of those that nothing catches."""
    faults = [Fault(**one) for one in json.loads(CHOSEN.read_text())]
    marks = ["-m", "not slow"] if quick else []
    missed = 0
    with tempfile.TemporaryDirectory() as directory:
        source = Source(Path(directory))
        for fault in faults:
            module = ROOT / "src/uavrt" / fault.path
            if not module.exists() or with_fault(fault, module.read_text("utf-8")) is None:
                missed += 1
                print(
                    f"{fault.path} {fault.function}, {fault.kind}: rewritten since", flush=True
                )
                continue
            before = [fault.caught_by, *fault.tests]
            known = dict.fromkeys(filter(None, map(present, before)))
            if quick:
                known = {one: None for one in known if one.startswith("tests/unit")}
            caught = None
            for selection in ([*known][:1], [*known][1:], [f"tests/unit/{fault.package}"]):
                caught = caught or (selection and source.catches(fault, *selection, *marks))
            missed += not caught
            print(f"{fault.path} {fault.function}, {fault.kind}: {caught}", flush=True)
    print(f"{len(faults) - missed} of {len(faults)} caught")
    return missed


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    choosing = commands.add_parser("choose", help="pick forty faults that the tests catch")
    choosing.add_argument("coverage", type=Path)
    choosing.add_argument("--seed", type=int, default=1)
    checking = commands.add_parser("check", help="which of the forty are caught now")
    checking.add_argument("--quick", action="store_true", help="by the tests of `make check`")
    asked = parser.parse_args()
    if asked.command == "choose":
        choose(asked.coverage, asked.seed)
        return 0
    return check(asked.quick)


if __name__ == "__main__":
    sys.exit(main())
