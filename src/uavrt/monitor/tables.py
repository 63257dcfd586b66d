"""Tables in a terminal, drawn alike by all commands."""

from typing import Any

from rich.table import Table


def table_of(*titles: str, left: tuple[str, ...] = ("tag", "name"), **style: Any) -> Table:
    """Make a table without rows; titles in `left` are of words, at the left."""
    table = Table(**style)
    for title in titles:
        table.add_column(title, justify="left" if title in left else "right")
    return table


def plain_table(*titles: str) -> Table:
    """Make a table without lines, as wide as the terminal."""
    left = ("tag", "process", "status")
    return table_of(*titles, left=left, expand=True, box=None, header_style="dim")
