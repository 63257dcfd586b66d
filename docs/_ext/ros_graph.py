"""``{uavrt-ros-graph}``: the ROS 2 nodes and topics, out of the tables."""

from typing import Any

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from uavrt.ros2 import NODES, TOPICS, definition
from uavrt.ros2.graph import LOG_MESSAGE, LOG_TOPIC
from uavrt.ros2.messages import RosPulse, RosPulsePose, RosTag

Rows = list[tuple[str, ...]]
OWN = (RosPulse, RosPulsePose, RosTag)


class RosGraph(SphinxDirective):
    """A table of the nodes, of the topics, or the messages' fields."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Show what the argument names."""
        what = directives.choice(self.arguments[0], ("nodes", "topics", "messages"))
        if what == "nodes":
            return [_table(("node", "speaks of"), list(NODES.items()))]
        if what == "topics":
            rows: Rows = [
                (
                    topic.name,
                    topic.message.ros_name,
                    topic.publisher,
                    ", ".join(topic.subscribers),
                    topic.meaning,
                )
                for topic in TOPICS.values()
            ]
            rows.append((LOG_TOPIC, LOG_MESSAGE.ros_name, "each node", "", "its log"))
            return [_table(("topic", "type", "from", "to", "meaning"), rows)]
        text = "\n".join(f"# {kind.ros_name}\n{definition(kind)}" for kind in OWN)
        return [nodes.literal_block(text, text, language="text")]


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
