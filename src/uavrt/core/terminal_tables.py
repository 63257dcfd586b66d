"""Create tables for a terminal, with a common style."""

from typing import Any

from rich.table import Table


def table_of(*titles: str, left: tuple[str, ...] = ("tag", "name"), **style: Any) -> Table:
    """Create an empty table; columns with a title in `left` are aligned left."""
    table = Table(**style)
    for title in titles:
        table.add_column(title, justify="left" if title in left else "right")
    return table


def plain_table(*titles: str) -> Table:
    """Create an empty table without lines, as wide as the terminal."""
    left = ("tag", "process", "status")
    return table_of(*titles, left=left, expand=True, box=None, header_style="dim")
