"""Tags as the user typed them, before validation, and the faults found in them."""

from dataclasses import dataclass, field
from typing import Literal

Quantity = Literal[
    "id",
    "frequency",
    "interval",
    "second_interval",
    "pulse_width",
    "interval_uncertainty",
    "interval_jitter",
    "k",
    "false_alarm_probability",
    "frequency_slide",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault of a file, with its line."""

    line: int
    text: str

    def __str__(self) -> str:
        return f"line {self.line}: {self.text}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A number as the user typed it, with its name, line and unit in the file."""

    number: float
    label: str
    line: int
    unit: str = ""


@dataclass(slots=True, kw_only=True)
class TagDraft:
    """A tag as typed: times in milliseconds, frequency in the unit of its entry."""

    line: int
    entries: dict[Quantity, Entry] = field(default_factory=dict)
    name: str | None = None
    gaps: tuple[Entry, ...] | None = None
    """Gaps between the pulses of a coded tag's burst; its interval is then the burst interval.
    None for a tag that is not coded."""
