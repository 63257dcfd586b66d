"""Each line of the manual's threat table names a test that exists."""

import re
from pathlib import Path

TESTS = Path(__file__).parents[1]
PAGE = TESTS.parent / "docs/how-to/lock-the-link.md"
SHORT = {
    "attacks": "test_link_attacks.py",
    "sessions": "test_fresh_sessions.py",
    "seal": "test_seal.py",
}
NAMED = re.compile(r"(?:`(test_\w+\.py)|(attacks|sessions|seal) `|`…|`)::(test_\w+)`")


def names_in(name: str) -> set[str]:
    """Names of the tests in the file of that name, whatever folder it is in."""
    text = "\n".join(path.read_text("utf-8") for path in TESTS.rglob(name))
    return set(re.findall(r"^(?:async )?def (test_\w+)\(", text, re.MULTILINE))


def test_every_test_named_in_the_threat_table_is_there() -> None:
    text = PAGE.read_text("utf-8").partition("## What is protected")[2]
    file, missing, found = "", [], 0
    for one in NAMED.finditer(text):
        file = one[1] or SHORT.get(one[2] or "", file)
        found += 1
        if one[3] not in names_in(file):
            missing.append(f"{file}::{one[3]}")
    assert not missing
    assert found == text.count("::test_") > 30


def test_every_cell_of_the_threat_table_says_what_happens() -> None:
    text = PAGE.read_text("utf-8").partition("## What is protected")[2]
    rows = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("| ")]
    assert len(rows) > 20
    assert all(cell.strip() for row in rows for cell in row)
