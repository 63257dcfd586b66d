"""``{uavrt-ros-graph}``: the ROS 2 nodes and topics, out of the tables."""

from typing import Any

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from uavrt.link.ros2.graph import (
    LOG_MESSAGE,
    LOG_TOPIC,
    NODES,
    SERVICE_BURST,
    SERVICE_PER_S,
    TOPICS,
)
from uavrt.link.ros2.types.interface import definition, nested_messages

Rows = list[tuple[str, ...]]


class RosGraph(SphinxDirective):
    """A drawing of the graph, a table of nodes, topics or limits, or the messages' fields."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Show what the argument names."""
        choices = ("graph", "nodes", "topics", "limits", "messages")
        what = directives.choice(self.arguments[0], choices)
        if what == "graph":
            return [nodes.raw("", drawing(), format="html")]
        if what == "nodes":
            return [_table(("node", "subject"), list(NODES.items()))]
        if what == "topics":
            rows: Rows = [
                (
                    topic.name,
                    f"{topic.message.ros_name}\n{topic.publisher} → "
                    f"{', '.join(topic.subscribers) or 'any subscriber'}\n{topic.meaning}",
                )
                for topic in TOPICS.values()
            ]
            rows.append((LOG_TOPIC, f"{LOG_MESSAGE.ros_name}\neach node's log"))
            return [_list(rows)]
        if what == "limits":
            limits: Rows = [
                (topic.name, f"{topic.burst}", f"{topic.per_s:g}")
                for topic in TOPICS.values()
                if topic.subscribers
            ]
            limits.append(
                ("requests to each service", f"{SERVICE_BURST}", f"{SERVICE_PER_S:g}")
            )
            return [_table(("topic", "read at once", "then each second"), limits)]
        kinds = dict.fromkeys(
            kind
            for topic in TOPICS.values()
            for kind in (*nested_messages(topic.message), topic.message)
        )
        own = [kind for kind in kinds if kind.ros_name.startswith("uavrt_interfaces/")]
        text = "\n".join(f"# {kind.ros_name}\n{definition(kind)}" for kind in own)
        return [nodes.literal_block(text, text, language="text")]


COLUMNS = 3
BOX_WIDTH, BOX_HEIGHT, ROW_HEIGHT = 210, 36, 150
LEFT, STEP = 20, 360
PLACES = {
    "TelemetryComponent": (0, 0),
    "CommandComponent": (0, 1),
    "StartStopComponent": (1, 1),
    "DetectorComponent": (2, 0),
    "ChannelizerComponent": (2, 1),
    "AirspyCSDRNetcatComponent": (2, 2),
}
"""Column and row of each node, as in the thesis's Fig. 2.1; a new node must be placed here."""


def drawing() -> str:
    """Draw nodes as boxes, and between each pair one line with the topics it carries."""
    edges: dict[tuple[str, str], list[str]] = {}
    for topic in TOPICS.values():
        for node in topic.subscribers:
            edges.setdefault((topic.publisher, node), []).append(topic.name)
    parts = [_line(*pair, names) for pair, names in edges.items()]
    parts += [_box(node) for node in NODES]
    width, height = LEFT * 2 + STEP * (COLUMNS - 1) + BOX_WIDTH, ROW_HEIGHT * 3
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" '
        'aria-label="Nodes and the topics between them" fill="currentColor" '
        'stroke="currentColor" font-family="sans-serif" font-size="13">'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" '
        'markerHeight="8" orient="auto-start-reverse"><path d="M0 0L8 4L0 8z"/></marker></defs>'
        + "".join(parts)
        + "</svg>"
    )


def _middle(node: str) -> tuple[float, float]:
    column, row = PLACES[node]
    return LEFT + STEP * column + BOX_WIDTH / 2, ROW_HEIGHT * row + ROW_HEIGHT / 2


def _box(node: str) -> str:
    x, y = _middle(node)
    left, top = x - BOX_WIDTH / 2, y - BOX_HEIGHT / 2
    return (
        f'<rect x="{left}" y="{top}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="6" '
        f'fill="none"/><text x="{x}" y="{y + 5}" text-anchor="middle" stroke="none">'
        f"{node}</text>"
    )


def _line(source: str, target: str, names: list[str]) -> str:
    (x1, y1), (x2, y2) = _middle(source), _middle(target)
    if x1 == x2:
        y1, y2 = y1 + BOX_HEIGHT / 2, y2 - BOX_HEIGHT / 2
    else:
        side = BOX_WIDTH / 2 if x2 > x1 else -BOX_WIDTH / 2
        x1, x2 = x1 + side, x2 - side
    x, y = (x1 + x2) / 2, (y1 + y2) / 2
    texts = "".join(
        f'<text x="{x}" y="{y - 5 - 15 * (len(names) - 1 - number)}" text-anchor="middle" '
        # The page's own colour behind the words, where they cross a line.
        f'font-size="10" style="stroke: var(--pst-color-background, white); stroke-width: 4px; '
        f'paint-order: stroke">{name}</text>'
        for number, name in enumerate(names)
    )
    return (
        f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke-width="1.2" '
        f'marker-end="url(#tip)"/>{texts}'
    )


def _list(rows: Rows) -> nodes.definition_list:
    """A list of terms; the lines of each explanation below one another."""
    items = nodes.definition_list()
    for term, text in rows:
        lines = [nodes.line("", line) for line in text.split("\n")]
        explained = nodes.definition("", nodes.line_block("", *lines))
        name = nodes.term("", "", nodes.literal("", term))
        items += nodes.definition_list_item("", name, explained)
    return items


def _table(header: tuple[str, ...], rows: Rows) -> nodes.table:
    group = nodes.tgroup(cols=len(header))
    group += [nodes.colspec(colwidth=1) for _ in header]
    head, body = nodes.thead(), nodes.tbody()
    head += _row(header)
    body += [_row(row) for row in rows]
    group += [head, body]
    table = nodes.table()
    table += group
    return table


def _row(cells: tuple[str, ...]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        row += nodes.entry("", nodes.paragraph("", cell))
    return row


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("uavrt-ros-graph", RosGraph)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
