"""The documents say only what is there: links, commands, make targets, settings."""

import dataclasses
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from uavrt.cli.app import app
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


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_setting_shown_in_the_documents_exists(document: Path) -> None:
    tables = {field.name: field for field in dataclasses.fields(Settings)}
    for language, body in FENCE.findall(document.read_text(encoding="utf-8")):
        if language != "toml" or not re.search(
            rf"^\[({'|'.join(tables)})\]", body, re.MULTILINE
        ):
            continue
        for table, keys in tomllib.loads(body).items():
            default = tables[table].default_factory
            assert callable(default)
            known = {field.name for field in dataclasses.fields(default())}
            assert set(keys) <= known, table


def test_every_decision_has_its_own_number_and_says_it() -> None:
    pages = [path for path in DOCS if path.parent.name == "decisions" and path.stem != "index"]
    numbers = [path.stem[:4] for path in pages]
    assert len(set(numbers)) == len(numbers)
    for path in pages:
        title = path.read_text(encoding="utf-8").splitlines()[0]
        assert re.match(rf"# (Decision )?{path.stem[:4]}\b", title), name_of(path)
