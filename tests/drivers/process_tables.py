"""The tables as text for the manual: ``python tests/drivers/process_tables.py``."""

import sys

from uavrt.drone.ipc.topics import TOPICS, Topic
from uavrt.drone.supervisor.tree.table import (
    PROCESSES,
    ProcessRow,
    consumers_of,
    on_every_drone,
    while_receiving,
)


def processes_markdown() -> str:
    """Describe every process: when it runs, its limits."""
    lines = [
        "| process | what it does | when | silent at most | restarted | CPU | memory |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in PROCESSES:
        name = f"`{row.name}`" + (" × workers" if row.per_worker else "")
        lines.append(
            f"| {name} | {row.meaning} | {_when(row)} | {row.silence_limit_s:g} s | "
            f"{row.restart.words()} | {row.cpu_budget_percent:g} % | "
            f"{row.memory_limit_mb:g} MB |"
        )
    return "\n".join(lines)


def topics_markdown() -> str:
    """Describe which records go from where to where."""
    lines = ["| record | from | to | every | what it is |", "|---|---|---|---|---|"]
    for topic in TOPICS.values():
        producers = [row.name for row in PROCESSES if topic.name in row.produces]
        consumers = [row.name for row in consumers_of(topic.name)]
        lines.append(
            f"| `{topic.name}` | {', '.join(producers) or 'supervisor'} | "
            f"{', '.join(consumers) or '–'} | {_every(topic)} | {topic.meaning} |"
        )
    return "\n".join(lines)


def _every(topic: Topic) -> str:
    if topic.every_s is None:
        return "–"
    return f"{topic.every_s:g} s" + (" and tag" if topic.each_tag else "")


def _when(row: ProcessRow) -> str:
    when = str(row.runs.__name__).replace("_", " ")
    if row.runs is while_receiving:
        when = "while detecting or capturing"
    return when if row.configured is on_every_drone else f"{when}, if configured"


if __name__ == "__main__":
    sys.stdout.write(f"{processes_markdown()}\n\n{topics_markdown()}\n")
