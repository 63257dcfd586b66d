"""Which code a table of results was measured with, and whether it is still that code.

Beneath the title of each part of a table stands the commit and a digest of the folders that
its figures come from, with that of the compiled kernels where these do part of the work. The
digest is of the code alone: comments, docstrings and layout do not count. Where code has
changed since, `make claims-status` lists the part, unless it says why:

- `Code d since: reason` names a later digest whose change cannot touch the figures.
- `To be measured again: reason` says that the figures may no longer hold.

Run as ``python -m uavrt_experiments.measured`` to show and to enter these lines.
"""

import argparse
import ast
import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import uavrt

SOURCE = Path(uavrt.__file__).parent
ROOT = SOURCE.parents[1]
NATIVE = ROOT / "native"
"""The compiled kernels, which do part of the work of `_WITH_KERNELS`."""
_WITH_KERNELS = frozenset({"detection", "dsp"})
_C_COMMENT = re.compile(r'"(?:\\.|[^"\\])*"|/\*.*?\*/|//[^\n]*', re.DOTALL)
DETECTOR_TABLE = "docs/images/detection/results.json"
_DETECTOR_PAGE = "docs/images/detection/results.md"
_BENCHMARKS = "benchmarks/results.md"
_SEARCH_PAGE = "docs/reference/search-bars.md"
_ALL = ("detection", "dsp", "localization", "tunnel")

_LINE = re.compile(r"Measured on commit `([^`]+)`, code `(\w+)` of ([\w, ]+)\.")
_SINCE = re.compile(r"- Code `(\w+)` since: (.+)")
_AGAIN = re.compile(r"- To be measured again: (.+)")

State = Literal["current", "entered", "to be measured again", "changed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A part of a table, and what was written of its measurement."""

    name: str
    """As on the command line: E3, localization, bench chain …"""
    path: str
    """Of the page, from the root of the repository."""
    folders: tuple[str, ...]
    commit: str
    code: str
    since: tuple[tuple[str, str], ...] = ()
    """Later digests that cannot touch the figures, and why."""
    again: tuple[str, ...] = ()
    """Why the figures may no longer hold."""

    @property
    def state(self) -> State:
        """Whether the figures are those of the code as it is."""
        now = digest(self.folders)
        if now == self.code:
            return "current"
        if self.again:
            return "to be measured again"
        return "entered" if now in (code for code, _ in self.since) else "changed"

    @property
    def command(self) -> str:
        """What measures it again."""
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

    Parameters
    ----------
    folders : sequence of str
        Names below `source`.
    source : Path
    native : Path
        Where the compiled kernels' sources are; they count with what uses them.
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
    """A C file without comments and layout."""
    text = path.read_text(encoding="utf-8")
    bare = _C_COMMENT.sub(lambda m: m[0] if m[0].startswith('"') else " ", text)
    return " ".join(bare.split())


@lru_cache(maxsize=1024)
def _of_file(path: Path, time_ns: int, size: int) -> str:
    """Digest of a file's code; time and size tell that it is another."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return hashlib.sha256(" ".join(_tokens(tree)).encode()).hexdigest()


def _tokens(node: object) -> Iterator[str]:
    """What a syntax tree says, in the same words for every version of Python."""
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
    """Commit of the source, with -dirty behind it when files differ; else the version."""
    command = ("git", "-C", str(ROOT), "describe", "--always", "--dirty")
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        return uavrt.__version__
    told = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10.0)
    return told.stdout.strip() or uavrt.__version__


def in_history(named: str, root: Path = ROOT) -> bool | None:
    """Whether a commit that a table names is one of this clone's history.

    Parameters
    ----------
    named : str
        As written beneath a title; -dirty behind it does not count.
    root : Path

    Returns
    -------
    bool or None
        None where nobody can tell: without git, or in a shallow clone.
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


def measured_now(folders: Sequence[str]) -> str:
    """Line to write beneath the title of what is measured with the code as it is."""
    return f"Measured on commit `{commit()}`, code `{digest(folders)}` of {', '.join(folders)}."


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
            notes = text[found.end() :].lstrip("\n").split("\n\n", 1)[0]
            parts.append(
                Part(
                    name=name,
                    path=path,
                    folders=tuple(found[3].split(", ")),
                    commit=found[1],
                    code=found[2],
                    since=tuple((m[1], m[2]) for m in _SINCE.finditer(notes)),
                    again=tuple(m[1] for m in _AGAIN.finditer(notes)),
                )
            )
    return parts


def _pages(root: Path) -> Iterator[str]:
    for path in sorted((root / "docs").rglob("*.md")):
        name = path.relative_to(root).as_posix()
        if name != _DETECTOR_PAGE and _LINE.search(path.read_text(encoding="utf-8")):
            yield name


def _name(path: str, before: str) -> str:
    """Name of the part that a line belongs to, from what stands before it."""
    if path == _DETECTOR_PAGE:
        return str(re.findall(r"^## (E\d+)", before, re.MULTILINE)[-1])
    if path == _BENCHMARKS:
        return "bench " + str(re.findall(r"^## (\w+)", before, re.MULTILINE)[-1])
    if path == _SEARCH_PAGE:
        return "search " + str(re.findall(r"^## ([\w-]+)", before, re.MULTILINE)[-1])
    asked = re.findall(r"uavrt experiment (\w+)", before)
    return str(asked[-1]) if asked else Path(path).stem


def enter(part: Part, line: str, root: Path = ROOT) -> None:
    """Write a line beneath a part's.

    Parameters
    ----------
    part : Part
    line : str
        One of the two forms; see above.
    root : Path
    """
    page = root / part.path
    text = page.read_text(encoding="utf-8")
    head = next(
        found[0]
        for found in _LINE.finditer(text)
        if _name(part.path, text[: found.start()]) == part.name
    )
    # Two parts may say the same: the title tells which is meant.
    titles = {
        "bench": f"## {part.name.removeprefix('bench ')}\n",
        "search": f"## {part.name.removeprefix('search ')}: ",
        "E": f"## {part.name}: ",
    }
    title = next((t for start, t in titles.items() if part.name.startswith(start)), "")
    at = text.index(head, text.index(title)) + len(head)
    rest = text[at:].lstrip("\n")
    page.write_text(
        text[:at] + "\n\n" + line + ("\n" if rest.startswith("- ") else "\n\n") + rest,
        encoding="utf-8",
    )
    table = root / DETECTOR_TABLE
    if part.path == _DETECTOR_PAGE and table.exists():
        known = json.loads(table.read_text(encoding="utf-8"))
        origin = known["origins"][part.name]
        origin["notes"] = [line, *origin.get("notes", [])]
        table.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")


def report(parts: Sequence[Part]) -> str:
    """What changed, what to run, and how to enter what needs no new measurement."""
    return "\n".join(
        f"{part.path}, {part.name}: measured on {part.commit} with code {part.code} of "
        f"{', '.join(part.folders)}, now {digest(part.folders)}. Measure again:\n"
        f"    {part.command}\n"
        "  or, if the change cannot touch the figures:\n"
        f"    python -m uavrt_experiments.measured enter '{part.name}' 'REASON'"
        for part in parts
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Show or enter; 1 when something changed without a word."""
    parser = argparse.ArgumentParser(
        prog="python -m uavrt_experiments.measured",
        description="Whether the tables of results are of the code as it is.",
    )
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("show", help="list the parts of all tables and their state")
    for name, told in (
        ("enter", "enter that the code as it is cannot have other figures"),
        ("again", "enter that the figures may no longer hold"),
    ):
        one = commands.add_parser(name, help=told)
        one.add_argument("parts", help="as shown, with commas; 'all changed' for all of these")
        one.add_argument("reason", help="one line")
    asked = parser.parse_args(arguments)
    parts = read_parts()
    if asked.command == "show":
        changed = [part for part in parts if part.state == "changed"]
        elsewhere = {c for c in {p.commit for p in parts} if in_history(c) is False}
        lines = [
            f"{p.name:16} {p.commit:20} {p.state:22} {p.path}"
            + (", on a commit that is not in this history" if p.commit in elsewhere else "")
            for p in parts
        ]
        sys.stdout.write("\n".join([*lines, *([report(changed)] if changed else [])]) + "\n")
        return 1 if changed else 0
    names = [name.strip() for name in asked.parts.split(",")]
    chosen = [
        part
        for part in parts
        if part.name in names or (asked.parts == "all changed" and part.state == "changed")
    ]
    if not chosen or "\n" in asked.reason or not asked.reason.strip():
        parser.error(f"give one line, and parts of: {', '.join(part.name for part in parts)}")
    for part in chosen:
        code = digest(part.folders)
        again = asked.command == "again"
        start = "- To be measured again:" if again else f"- Code `{code}` since:"
        enter(part, f"{start} {asked.reason.strip()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
