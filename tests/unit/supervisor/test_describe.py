"""The manual's tables are the tables."""

from pathlib import Path

import pytest
from process_tables import processes_markdown, topics_markdown

PAGE = Path(__file__).parents[3] / "docs/explanation/supervision.md"


@pytest.mark.parametrize("make", [processes_markdown, topics_markdown])
def test_the_manual_shows_the_table_as_it_is(make: object) -> None:
    assert callable(make)
    text = PAGE.read_text(encoding="utf-8")
    assert make() in text, "put in the output of python tests/drivers/process_tables.py"
