"""Settings, progress callbacks and summary of a batch."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from uavrt.analysis.archive.parquet.parquet_tables import FlightRow, RecordingRow
from uavrt.analysis.archive.steps.flight_work import PlacingSettings
from uavrt.analysis.archive.steps.recording_cells import CELL_S, LEAD_IN_S
from uavrt.core.errors import NotFound, UsageError

STEPS = ("detect", "attach", "bearing", "localize", "integrate")
USUAL_STEPS = STEPS[:-1]
"""Default steps of a batch; whole-flight analysis is left out, as it takes most time and
memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchSettings:
    """Settings for searching recordings, and for bearings and positions."""

    steps: tuple[str, ...] = USUAL_STEPS
    frequency_window_hz: float = 500.0
    cell_s: float = CELL_S
    lead_in_s: float = LEAD_IN_S
    workers: int = 1
    scheduler: str | None = None
    """Address of a Dask scheduler, such as tcp://HOST:PORT; None: this machine's cores."""
    verify: bool = False
    """True to read all earlier output, and compute damaged parts again."""
    placing: PlacingSettings = field(default_factory=PlacingSettings)

    def check(self) -> None:
        """Reject unknown steps, and steps that lack a step they need; raises `UsageError`."""
        if unknown := sorted(set(self.steps) - set(STEPS)):
            raise NotFound(
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
    """Callbacks that report progress, and stop a batch."""

    should_stop: Callable[[], bool] = lambda: False
    """Returns true to end the run; the next run continues it."""
    on_stage: Callable[[str, int], None] = lambda _name, _total: None
    """Receives the next stage and its size: ``detecting`` (samples), ``placing`` (flights)."""
    on_done: Callable[[int], None] = lambda _amount: None
    """Receives the number of samples or flights done since its last call."""
    on_row: Callable[[RecordingRow | FlightRow], None] = lambda _row: None
    on_kept: Callable[[str, str], None] = lambda _name, _fault: None
    """Receives each recording and flight that is not reachable now, and the reason; earlier
    results stay."""
    on_damage: Callable[[str, str], None] = lambda _name, _fault: None
    """Receives each missing or damaged output file, and the reason; it is made again."""
    on_wait: Callable[[str], None] = lambda _text: None
    """Receives a message for the user: what the run waits for, and the remedy."""
    on_origin: Callable[[str, str], None] = lambda _name, _origin: None
    """Receives each recording without a start time of its own, and the source used instead."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchSummary:
    """Counts and warnings of a finished batch."""

    rows: tuple[RecordingRow, ...]
    flights: tuple[FlightRow, ...]
    done_now: int
    done_before: int
    placed_now: int
    placed_before: int
    copies: int
    """Number of skipped directories that are a second copy of a flight."""
    kept: int
    """Number of recordings and flights not reachable now; earlier results stay."""
    stopped: bool
    damaged: Mapping[str, str]
    """Reason for each missing or damaged output file; it was made again."""
