"""The documents say only what is there: links, commands, make targets, settings."""

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from uavrt.cli.app import app
from uavrt.config import load_settings, read_tags
from uavrt.config.settings import Settings

ROOT = Path(__file__).parents[2]
DOCS = sorted(path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts)
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS]

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"^ *```(\w*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
CODE_SPAN = re.compile(r"`([^`\n]+)`")
COMMAND = re.compile(r"(?:^|[|&;]\s*|\.venv/bin/|\s)uavrt (\w[\w-]*)")
MAKE = re.compile(r"(?:^|\s)make (\w+)")


def name_of(document: Path) -> str:
    return str(document.relative_to(ROOT))


def code_in(text: str) -> Iterator[str]:
    """All code of a document: the bodies of its shell blocks, and its code spans."""
    for language, body in FENCE.findall(text):
        if language == "sh":
            yield from body.splitlines()
    yield from CODE_SPAN.findall(FENCE.sub("", text))


def anchors_in(document: Path) -> set[str]:
    """The anchors that headings get, in the repository's web view as in the manual."""
    text = FENCE.sub("", document.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_relative_link_leads_to_something(document: Path) -> None:
    text = FENCE.sub("", document.read_text(encoding="utf-8"))
    dead = []
    for link in LINK.findall(text):
        if re.match(r"\w+://|mailto:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (document.parent / path).resolve() if path else document
        if not target.exists() or (anchor and anchor not in anchors_in(target)):
            dead.append(link)
    assert not dead


def test_the_readme_names_only_commands_that_exist() -> None:
    named = {
        command
        for line in code_in((ROOT / "README.md").read_text(encoding="utf-8"))
        for command in COMMAND.findall(line)
    }
    registered = {name for name in app.resolved_commands() if not name.startswith("-")}
    assert named <= registered


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_make_target_in_the_documents_exists(document: Path) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^(\w+):", makefile, re.MULTILINE))
    text = document.read_text(encoding="utf-8")
    assert {target for line in code_in(text) for target in MAKE.findall(line)} <= targets


def blocks(language: str, starting_with: str) -> list[tuple[str, str]]:
    """Fenced blocks of all documents: name of the document, and the block's text."""
    return [
        (name_of(document), body)
        for document in DOCUMENTS
        for found, body in FENCE.findall(document.read_text(encoding="utf-8"))
        if found == language and re.match(starting_with, body)
    ]


def test_every_settings_file_in_the_documents_is_read_without_fault(tmp_path: Path) -> None:
    tables = "|".join(field.name for field in dataclasses.fields(Settings))
    shown = blocks("toml", rf"\[({tables})\]")
    assert shown
    for _, body in shown:
        path = tmp_path / "uavrt.toml"
        path.write_text(body, encoding="utf-8")
        load_settings(path)


def test_every_tag_file_in_the_documents_is_read_without_fault(tmp_path: Path) -> None:
    shown = blocks("text", "# id, freq_hz")
    assert shown
    for _, body in shown:
        path = tmp_path / "TagInfo.txt"
        path.write_text(body, encoding="utf-8")
        assert read_tags(path)


def test_the_map_of_the_code_names_every_package_and_only_files_that_exist() -> None:
    page = (ROOT / "docs/explanation/where-does-it-live.md").read_text(encoding="utf-8")
    spans = set(CODE_SPAN.findall(FENCE.sub("", page)))
    source = ROOT / "src/uavrt"
    packages = {path.parent.name for path in source.glob("*/__init__.py")}
    assert packages <= spans
    paths = {span for span in spans if re.fullmatch(r"[\w/]+(/|\.py)", span)}
    assert {
        span for span in paths if not ((source / span).exists() or (ROOT / span).exists())
    } == set()


def test_every_decision_has_its_own_number_and_says_it() -> None:
    pages = [path for path in DOCS if path.parent.name == "decisions" and path.stem != "index"]
    numbers = [path.stem[:4] for path in pages]
    assert len(set(numbers)) == len(numbers)
    for path in pages:
        title = path.read_text(encoding="utf-8").splitlines()[0]
        assert re.match(rf"# (Decision )?{path.stem[:4]}\b", title), name_of(path)
