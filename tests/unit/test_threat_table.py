"""Each line of the manual's threat tables cites a test that exists."""

import re
from pathlib import Path

TESTS = Path(__file__).parents[1]
PAGE = TESTS.parent / "docs/explanation/attacks-on-the-link.md"
NAMED = re.compile(r"^\| (\d+) \| `(test_\w+\.py)::(test_\w+)` \|$", re.MULTILINE)


def names_in(name: str) -> set[str]:
    """Names of the tests in the file of that name, whatever folder it is in."""
    text = "\n".join(path.read_text("utf-8") for path in TESTS.rglob(name))
    return set(re.findall(r"^(?:async )?def (test_\w+)\(", text, re.MULTILINE))


def test_every_test_listed_under_the_threat_tables_exists() -> None:
    text = PAGE.read_text("utf-8")
    listed = [(one[2], one[3]) for one in NAMED.finditer(text)]
    assert [one for one in listed if one[1] not in names_in(one[0])] == []
    assert len(listed) == text.count("::test_") > 30


def test_every_number_in_the_threat_tables_is_a_listed_test_and_the_reverse() -> None:
    text = PAGE.read_text("utf-8")
    cited = {int(n) for one in re.findall(r"\[([\d, ]+)\]", text) for n in one.split(",")}
    assert sorted(cited) == [int(one[1]) for one in NAMED.finditer(text)]


def test_every_cell_of_the_threat_tables_says_what_happens() -> None:
    lines = PAGE.read_text("utf-8").splitlines()
    rows = [line.strip("|").split("|") for line in lines if line.startswith("| ")]
    assert len(rows) > 20
    assert all(cell.strip() for row in rows for cell in row)
