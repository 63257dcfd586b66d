"""The manual's page with the tables, each with the command that repeats it."""

import re
from collections.abc import Sequence
from pathlib import Path

from uavrt_experiments.result import Row
from uavrt_experiments.search.catalogue import SCENARIOS
from uavrt_experiments.search.processes import PROCESSES
from uavrt_experiments.search.scenario import Scenario
from uavrt_experiments.search.table import asked_and_reached, figure_text
from uavrt_experiments.tables import markdown

_SECTION = re.compile(r"<!-- begin ([\w-]+) -->\n.*?<!-- end \1 -->\n", re.DOTALL)


def page_section(scenario: Scenario, rows: Sequence[Row], command: str, measured: str) -> str:
    """Format a table as Markdown; figures that miss their requirement are bold.

    `rows`: as `results` makes them.
    `command`: command that repeats the table.
    `measured`: line about the measured code.
    """

    def cell(one: Row) -> str:
        text = figure_text(one)
        return text if one.met else f"**{text}**"

    heads, lines = asked_and_reached(scenario, rows, cell)
    parts = [f"## {scenario.name}: {scenario.title}", f"Command: `{command}`", measured]
    return "\n\n".join([*parts, markdown((heads, *lines))])


def put_section(page: Path, name: str, text: str) -> None:
    """Put a table into the page, in place of its earlier one; the rest stays.

    Tables are in the order of the catalogue; that of the real processes is last.

    `name`: name of the table.
    """
    old = page.read_text(encoding="utf-8") if page.exists() else ""
    sections = {found[1]: found[0] for found in _SECTION.finditer(old)}
    first = _SECTION.search(old)
    top = old[: first.start()] if first else old
    sections[name] = f"<!-- begin {name} -->\n\n{text}\n\n<!-- end {name} -->\n"
    known = [one for one in (*SCENARIOS, PROCESSES) if one in sections]
    page.write_text(
        "\n".join([top.rstrip("\n") + "\n", *(sections[one] for one in known)]).lstrip("\n"),
        encoding="utf-8",
    )
