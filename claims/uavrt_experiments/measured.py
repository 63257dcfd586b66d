"""Code, date and machine of a table of results.

Below the title of each part of a table is a line with the commit, the date, the machine, and a
digest of the folders that its figures depend on. The digest includes the compiled kernels if
these do part of the work. It covers the code only: comments, docstrings and layout do not
count.

``python -m uavrt_experiments.measured`` lists the parts that are older than their code.
"""

import ast
import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

import uavrt

SOURCE = Path(uavrt.__file__).parent
ROOT = SOURCE.parents[1]
NATIVE = ROOT / "native"
"""Source of the compiled kernels, which do part of the work of `_WITH_KERNELS`."""
_WITH_KERNELS = frozenset({"detection", "dsp"})
_C_COMMENT = re.compile(r'"(?:\\.|[^"\\])*"|/\*.*?\*/|//[^\n]*', re.DOTALL)
_DETECTOR_PAGE = "docs/images/detection/results.md"
_BENCHMARKS = "benchmarks/results.md"
_SEARCH_PAGE = "docs/reference/search-bars.md"

_LINE = re.compile(r"Measured on commit `([^`]+)`(?:, [^`\n]+)?, code `(\w+)` of ([\w/, ]+)\.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A part of a table, and the record of its measurement."""

    name: str
    """Name on the command line: E3, localization, bench chain …"""
    path: str
    """Path of the page, from the root of the repository."""
    folders: tuple[str, ...]
    commit: str
    code: str

    @property
    def current(self) -> bool:
        """True if the figures are those of the present code."""
        return digest(self.folders) == self.code

    @property
    def command(self) -> str:
        """Command that repeats the measurement."""
        if self.name.startswith("bench "):
            return f"python -m benchmarks {self.name.removeprefix('bench ')}"
        if self.path == _DETECTOR_PAGE:
            where = Path(self.path).parent
            return (
                f"uavrt experiment detection --only {self.name} --trials 200 "
                f"--output-dir {where}"
            )
        if self.path == _SEARCH_PAGE:
            table = self.name.removeprefix("search ")
            chosen = "--processes 5" if table == "processes" else f"--only {table}"
            return f"uavrt experiment search {chosen} --page {_SEARCH_PAGE}"
        return f"uavrt experiment {self.name}"


def digest(folders: Sequence[str], source: Path = SOURCE, native: Path = NATIVE) -> str:
    """Digest of the code of some folders of the package: 12 hexadecimal digits.

    `folders`: names below `source`.
    `native`: folder of the compiled kernels' sources, which are included if the folders use
    them.
    """
    found = hashlib.sha256()
    for folder in sorted(folders):
        for path in sorted((source / folder).rglob("*.py")):
            state = path.stat()
            code = _of_file(path, state.st_mtime_ns, state.st_size)
            found.update(f"{path.relative_to(source).as_posix()} {code}\n".encode())
    if _WITH_KERNELS.intersection(folders):
        for path in sorted([*native.glob("*.c"), *native.glob("*.h")]):
            found.update(f"native/{path.name} {_c_code(path)}\n".encode())
    return found.hexdigest()[:12]


def _c_code(path: Path) -> str:
    """Text of a C file without comments and layout."""
    text = path.read_text(encoding="utf-8")
    bare = _C_COMMENT.sub(lambda m: m[0] if m[0].startswith('"') else " ", text)
    return " ".join(bare.split())


@lru_cache(maxsize=1024)
def _of_file(path: Path, time_ns: int, size: int) -> str:
    """Digest of a file's code, cached by time and size."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return hashlib.sha256(" ".join(_tokens(tree)).encode()).hexdigest()


def _tokens(node: object) -> Iterator[str]:
    """Tokens of a syntax tree, the same for every version of Python."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return  # a docstring
    if isinstance(node, ast.AST):
        yield type(node).__name__
        for name, value in ast.iter_fields(node):
            if name not in ("ctx", "kind", "type_comment") and value not in (None, []):
                yield name
                yield from _tokens(value)
    elif isinstance(node, list):
        yield "["
        for item in node:
            yield from _tokens(item)
        yield "]"
    else:
        yield repr(node)


def commit() -> str:
    """Commit of the source, with -dirty appended if files differ; without git, the version."""
    command = ("git", "-C", str(ROOT), "describe", "--always", "--dirty")
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        return uavrt.__version__
    answer = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10.0)
    return answer.stdout.strip() or uavrt.__version__


def in_history(named: str, root: Path = ROOT) -> bool | None:
    """True if a commit that a table names is in this clone's history.

    `named`: commit as written below a title; -dirty after it does not count.
    Returns: None if unknown: without git, or in a shallow clone.
    """
    if not (root / ".git").exists() or shutil.which("git") is None:
        return None

    def git(*command: str) -> subprocess.CompletedProcess[str]:
        line = ("git", "-C", str(root), *command)
        return subprocess.run(line, capture_output=True, text=True, check=False, timeout=10.0)

    if git("rev-parse", "--is-shallow-repository").stdout.strip() != "false":
        return None
    bare = named.removesuffix("-dirty")
    return git("merge-base", "--is-ancestor", bare, "HEAD").returncode == 0


def processor() -> str:
    """Name of the processor."""
    cpuinfo = Path("/proc/cpuinfo")
    text = cpuinfo.read_text(encoding="utf-8") if cpuinfo.exists() else ""
    found = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return re.sub("[`,]", "", found[1]) if found else platform.machine()


def measured_now(folders: Sequence[str]) -> str:
    """Line below the title of a measurement with the present code."""
    day = f"{datetime.now(tz=UTC):%Y-%m-%d}"
    machine = f"{os.cpu_count()} cores of {processor()}"
    code = f"code `{digest(folders)}` of {', '.join(folders)}"
    return f"Measured on commit `{commit()}`, {day}, {machine}, {code}."


def read_parts(root: Path = ROOT) -> list[Part]:
    """Parts of all tables of results in a clone."""
    parts = []
    for path in (_DETECTOR_PAGE, _BENCHMARKS, *_pages(root)):
        page = root / path
        if not page.exists():
            continue
        text = page.read_text(encoding="utf-8")
        for found in _LINE.finditer(text):
            name = _name(path, text[: found.start()])
            parts.append(
                Part(
                    name=name,
                    path=path,
                    folders=tuple(found[3].split(", ")),
                    commit=found[1],
                    code=found[2],
                )
            )
    return parts


def _pages(root: Path) -> Iterator[str]:
    for path in sorted((root / "docs").rglob("*.md")):
        name = path.relative_to(root).as_posix()
        if name != _DETECTOR_PAGE and _LINE.search(path.read_text(encoding="utf-8")):
            yield name


def _name(path: str, before: str) -> str:
    """Name of the part that a line belongs to, from the text before it."""
    if path == _DETECTOR_PAGE:
        return str(re.findall(r"^## (E\d+)", before, re.MULTILINE)[-1])
    if path == _BENCHMARKS:
        return "bench " + str(re.findall(r"^## (\w+)", before, re.MULTILINE)[-1])
    if path == _SEARCH_PAGE:
        return "search " + str(re.findall(r"^## ([\w-]+)", before, re.MULTILINE)[-1])
    asked = re.findall(r"uavrt experiment (\w+)", before)
    return str(asked[-1]) if asked else Path(path).stem


def main() -> int:
    """List the parts of all tables; returns 1 if some are older than their code."""
    parts = read_parts()
    elsewhere = {one for one in {part.commit for part in parts} if in_history(one) is False}
    for part in parts:
        state = "current" if part.current else f"older: {part.command}"
        lost = ", on a commit that is not in this history" if part.commit in elsewhere else ""
        sys.stdout.write(f"{part.name:16} {part.commit:20} {part.path}{lost}; {state}\n")
    return 0 if all(part.current for part in parts) else 1


if __name__ == "__main__":
    sys.exit(main())
