"""The documents say only what is there: links, commands, make targets, settings."""

import ast
import dataclasses
import re
import runpy
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from uavrt.cli.app import make_app
from uavrt.config.loader import load_settings
from uavrt.config.settings import Settings
from uavrt.config.tags.tag_files import read_tags

ROOT = Path(__file__).parents[2]
app = make_app(added=True)
DOCS = sorted(path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts)
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS]

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"^ *```(\w*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
CODE_SPAN = re.compile(r"`([^`\n]+)`")
COMMAND = re.compile(r"(?:^|[|&;]\s*|\.venv/bin/|\s)uavrt (\w[\w-]*)")
CODE = {".py", ".ts", ".sh", ".c", ".h"}
MAKE = re.compile(r"(?:^|\s)make ([\w-]+)")


def name_of(document: Path) -> str:
    return str(document.relative_to(ROOT))


def code_in(text: str) -> Iterator[str]:
    """All code of a document: the bodies of its shell blocks, and its code spans."""
    for language, body in FENCE.findall(text):
        if language == "sh":
            yield from body.splitlines()
    yield from CODE_SPAN.findall(FENCE.sub("", text))


@cache
def anchors_in(document: Path) -> set[str]:
    """The anchors that headings get, in the repository's web view as in the manual."""
    text = FENCE.sub("", document.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in headings}


def test_every_relative_link_leads_to_something() -> None:
    links = [
        (document, link)
        for document in DOCUMENTS
        for link in LINK.findall(FENCE.sub("", document.read_text(encoding="utf-8")))
        if not re.match(r"\w+://|mailto:", link)
    ]
    assert len(links) > 200
    dead = []
    for document, link in links:
        path, _, anchor = link.partition("#")
        target = (document.parent / path).resolve() if path else document
        if not target.exists() or (anchor and anchor not in anchors_in(target)):
            dead.append(f"{name_of(document)}: {link}")
    assert dead == []


def command_lines(document: Path) -> Iterator[tuple[str, list[str]]]:
    """Each `uavrt` command of a document, with the options that it is given there."""
    text = document.read_text(encoding="utf-8").replace("\\\n", " ")
    for line in code_in(text):
        for part in re.split(r"[|;&]", line.partition(" # ")[0]):
            for name in COMMAND.findall(part):
                rest = part.partition(name)[2]
                group = app[name] if name in app.resolved_commands() else None
                if group is not None and group.default_command is None:
                    inner = rest.split()[0] if rest.split() else ""
                    name = f"{name} {inner}".strip()
                yield name, re.findall(r"(?<=\s)--?[a-zA-Z][\w-]*", rest)


@cache
def options_of(command: str) -> set[str] | None:
    """The options of a command; None where there is no such command."""
    name, _, inner = command.partition(" ")
    registered = {name for name in app.resolved_commands() if not name.startswith("-")}
    if name not in registered or (inner and inner not in app[name].resolved_commands()):
        return None
    if app[name].default_command is None and not inner:
        return set()  # the group itself, as in "see `uavrt tags`"
    arguments = (app[name][inner] if inner else app[name]).assemble_argument_collection()
    return {name for argument in arguments for name in argument.names} | {"--help"}


def test_every_command_and_option_in_the_documents_exists() -> None:
    shown = [(name_of(one), *line) for one in DOCUMENTS for line in command_lines(one)]
    assert len(shown) > 300
    assert [
        f"{document}: uavrt {command} {' '.join(options)}"
        for document, command, options in shown
        if (known := options_of(command)) is None or not set(options) <= known
    ] == []


def test_what_is_filled_in_for_a_board_needs_nothing_but_an_installed_drone() -> None:
    """No development environment, nor a path of this repository, is there."""
    page = (ROOT / "docs/how-to/try-on-64-bit-arm.md").read_text()
    table = page.split("## What only a real board shows")[1]
    commands = [code for line in table.splitlines() for code in CODE_SPAN.findall(line)]
    assert sum(code.startswith("uavrt ") for code in commands) >= 5
    elsewhere = ("python", "benchmarks", "deploy/", "venv", "make ")
    assert [code for code in commands if any(word in code for word in elsewhere)] == []


def test_the_readme_shows_the_commands_of_a_flight() -> None:
    shown = {command for command, _ in command_lines(ROOT / "README.md")}
    assert {"demo", "detect", "run", "ground"} <= shown


def test_every_make_target_in_the_documents_exists() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE))
    named = [
        (name_of(document), target)
        for document in DOCUMENTS
        for line in code_in(document.read_text(encoding="utf-8"))
        for target in MAKE.findall(line)
    ]
    assert len(named) > 10
    assert [one for one in named if one[1] not in targets] == []


def blocks(language: str, starting_with: str) -> list[tuple[str, str]]:
    """Fenced blocks of all documents: name of the document, and the block's text."""
    return [
        (name_of(document), body)
        for document in DOCUMENTS
        for found, body in FENCE.findall(document.read_text(encoding="utf-8"))
        if found == language and re.match(starting_with, body)
    ]


def test_every_settings_and_tag_file_in_the_documents_is_read_without_fault(
    tmp_path: Path,
) -> None:
    tables = "|".join(field.name for field in dataclasses.fields(Settings))
    for name, shown, read in (
        ("uavrt.toml", blocks("toml", rf"\[({tables})\]"), load_settings),
        ("TagInfo.txt", blocks("text", "# id, freq_hz"), read_tags),
    ):
        assert shown
        for _, body in shown:
            path = tmp_path / name
            path.write_text(body, encoding="utf-8")
            assert read(path)


def test_the_map_of_the_code_is_as_its_script_writes_it_and_names_files_that_exist() -> None:
    page = (ROOT / "docs/explanation/where-does-it-live.md").read_text(encoding="utf-8")
    script = runpy.run_path(str(ROOT / "docs/_ext/code_map.py"))
    assert page == script["written"](page), "run: python docs/_ext/code_map.py"
    spans = set(CODE_SPAN.findall(FENCE.sub("", page)))
    source = ROOT / "src/uavrt"
    assert {path.parent.name for path in source.glob("*/__init__.py")} <= spans
    paths = {span for span in spans if re.fullmatch(r"[\w/]+(/|\.py)", span)}
    assert {
        span for span in paths if not ((source / span).exists() or (ROOT / span).exists())
    } == set()


def test_every_module_that_a_package_presents_exists() -> None:
    """In `__init__` a lower-case name is a module of the package, or one of its functions."""
    for package in (ROOT / "src/uavrt").rglob("__init__.py"):
        text = ast.get_docstring(ast.parse(package.read_text(encoding="utf-8"))) or ""
        modules = list(package.parent.rglob("*.py"))
        there = {path.stem for path in modules} | {path.parent.name for path in modules}
        for name in set(re.findall(r"(?<!`)`([a-z_0-9]+)`(?!`)", text)) - there:
            defined = (f"def {name}(" in path.read_text(encoding="utf-8") for path in modules)
            assert any(defined), f"{name_of(package)}: {name}"


def test_where_a_change_goes_is_told_by_files_that_exist() -> None:
    page = (ROOT / "docs/how-to/extend.md").read_text(encoding="utf-8")
    table = page.partition("## In uavrt itself")[2]
    paths = {span for span in CODE_SPAN.findall(table) if re.search(r"/$|\.(py|ts)$", span)}
    assert len(paths) > 10
    source = ROOT / "src/uavrt"
    assert not {one for one in paths if not ((source / one).exists() or (ROOT / one).exists())}


DECISIONS = sorted((ROOT / "docs/decisions").glob("0*.md"))


def test_every_decision_has_one_number_one_status_and_the_same_four_parts() -> None:
    assert len({path.stem[:4] for path in DECISIONS}) == len(DECISIONS)
    for path in DECISIONS:
        title, _, status, *text = path.read_text(encoding="utf-8").splitlines()
        assert title.startswith(f"# {path.stem[:4]} "), name_of(path)
        assert re.match(r"Status: accepted, \d{4}-\d{2}-\d{2}\b", status), name_of(path)
        parts = [found[1] for line in text if (found := re.match(r"\*\*(\w+)\.\*\*", line))]
        assert parts == ["Context", "Decision", "Alternatives", "Consequences"], name_of(path)


def test_the_list_of_decisions_has_a_line_for_each_of_at_most_forty() -> None:
    page = (ROOT / "docs/decisions/index.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| \[(\d{4})\]\((.+?)\.md\) \| .{20,} \|$", page, re.MULTILINE)
    assert listed == [(path.stem[:4], path.stem) for path in DECISIONS]
    assert len(DECISIONS) <= 40


def test_every_decision_that_is_cited_exists() -> None:
    numbers = {path.stem[:4] for path in DECISIONS}
    cited = [*DOCUMENTS, ROOT / "CHANGELOG.md", ROOT / "hatch_build.py"]
    for folder in ("src", "claims", "tests", "docs/_ext", "page/src", "deploy", "native"):
        cited += [path for path in (ROOT / folder).rglob("*") if path.suffix in CODE]
    for path in cited:
        text = path.read_text(encoding="utf-8")
        assert set(re.findall(r"decisions?[/ ](0\d{3})\b", text)) <= numbers, name_of(path)
