"""How an archive is searched."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from uavrt.batch.cells import CELL_S, LEAD_IN_S
from uavrt.batch.flight_work import PlacingSettings
from uavrt.batch.tables import FlightRow, RecordingRow
from uavrt.errors import UsageError

STEPS = ("detect", "attach", "bearing", "localize", "integrate")
USUAL_STEPS = STEPS[:-1]
"""The last takes longer than all others together, and memory; who wants it asks for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchSettings:
    """How recordings are searched, and flights placed."""

    steps: tuple[str, ...] = USUAL_STEPS
    frequency_window_hz: float = 500.0
    cell_s: float = CELL_S
    lead_in_s: float = LEAD_IN_S
    workers: int = 1
    scheduler: str | None = None
    """Address of a Dask cluster that does the work instead of this machine's cores."""
    verify: bool = False
    """Read all that was written before, and do damaged parts again."""
    placing: PlacingSettings = field(default_factory=PlacingSettings)

    def check(self) -> None:
        """Refuse steps that do not exist, or lack the one before.

        Raises `UsageError`: which one.
        """
        if unknown := sorted(set(self.steps) - set(STEPS)):
            raise UsageError(
                f"there is no step {unknown[0]}", remedy=f"Choose from {', '.join(STEPS)}"
            )
        for before, step in (
            ("attach", "bearing"),
            ("bearing", "localize"),
            ("attach", "integrate"),
        ):
            if step in self.steps and before not in self.steps:
                raise UsageError(f"{step} needs {before}", remedy=f"Add the step {before}")


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchWatch:
    """Who looks on while a batch runs, and may end it."""

    should_stop: Callable[[], bool] = lambda: False
    """True ends the run; the next one goes on from there."""
    on_stage: Callable[[str, int], None] = lambda _name, _total: None
    """Takes what begins now, and how much there is to do."""
    on_done: Callable[[int], None] = lambda _amount: None
    """Takes how much was done since the last call."""
    on_row: Callable[[RecordingRow | FlightRow], None] = lambda _row: None
    """Takes each recording and each flight that is finished."""
    on_kept: Callable[[str, str], None] = lambda _name, _fault: None
    """Takes each recording and flight that cannot be reached now, and why; what was done of it
    stays."""
    on_damage: Callable[[str, str], None] = lambda _name, _fault: None
    """Takes each file of the output that is missing or damaged, and why; it is made again."""
    on_wait: Callable[[str], None] = lambda _text: None
    """Takes what the run waits for, and the remedy."""
    on_origin: Callable[[str, str], None] = lambda _name, _origin: None
    """Takes each recording to be searched whose start is not known from itself, and what it was
    taken from."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchSummary:
    """What a run did."""

    rows: tuple[RecordingRow, ...]
    """All recordings that the output knows."""
    flights: tuple[FlightRow, ...]
    """All flights that it knows."""
    done_now: int
    """Recordings."""
    done_before: int
    placed_now: int
    """Flights."""
    placed_before: int
    copies: int
    """Directories that were passed over: each holds a flight that another holds, too."""
    kept: int
    """Recordings and flights that cannot be reached now; what was done of them stays."""
    stopped: bool
    damaged: Mapping[str, str]
    """Files of the output that were missing or damaged, and why; they were made again."""
