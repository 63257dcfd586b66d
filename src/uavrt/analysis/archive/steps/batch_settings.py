"""Settings, progress callbacks and summary of a batch."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from uavrt.analysis.archive.parquet.parquet_tables import FlightRow, RecordingRow
from uavrt.analysis.archive.steps.flight_work import PlacingSettings
from uavrt.analysis.archive.steps.recording_cells import CELL_S, LEAD_IN_S
from uavrt.core.errors import NotFound, UsageError

STEPS = ("detect", "attach", "bearing", "localize", "integrate")
USUAL_STEPS = STEPS[:-1]
"""Steps of a batch by default: all but whole-flight analysis, which takes most time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchSettings:
    """Settings of a batch for detecting pulses and estimating bearings and positions."""

    steps: tuple[str, ...] = USUAL_STEPS
    frequency_window_hz: float = 500.0
    cell_s: float = CELL_S
    lead_in_s: float = LEAD_IN_S
    workers: int = 1
    scheduler: str | None = None
    """Address of a Dask scheduler, such as tcp://HOST:PORT; None to use this computer's
    cores."""
    verify: bool = False
    """True to read all output of earlier runs and compute damaged parts again."""
    placing: PlacingSettings = field(default_factory=PlacingSettings)

    def check(self) -> None:
        """Raise `UsageError` for an unknown step, or one without a step that it needs."""
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
                raise UsageError(
                    f"the step {step} needs the step {before}", remedy=f"Add the step {before}"
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchWatch:
    """Callbacks that report progress, and stop a batch."""

    should_stop: Callable[[], bool] = lambda: False
    """Function that returns true to end the run; the next run continues from there."""
    on_stage: Callable[[str, int], None] = lambda _name, _total: None
    """Function called with the next stage and its size: ``detecting`` (number of samples) or
    ``placing`` (number of flights)."""
    on_done: Callable[[int], None] = lambda _amount: None
    """Function called with the number of samples or flights finished since its last call."""
    on_row: Callable[[RecordingRow | FlightRow], None] = lambda _row: None
    on_kept: Callable[[str, str], None] = lambda _name, _fault: None
    """Function called with each recording or flight that is not reachable now, and the reason;
    its earlier results are kept."""
    on_damage: Callable[[str, str], None] = lambda _name, _fault: None
    """Function called with each missing or damaged output file, and the reason; the file is
    written again."""
    on_wait: Callable[[str], None] = lambda _text: None
    """Function called with a user message on what the run waits for and what to do."""
    on_origin: Callable[[str, str], None] = lambda _name, _origin: None
    """Function called with each recording whose file has no start time, and the source of the
    time used instead."""


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
    """Number of directories skipped because they contain a second copy of a flight."""
    kept: int
    """Number of recordings and flights not reachable now; their earlier results are kept."""
    stopped: bool
    damaged: Mapping[str, str]
    """Missing or damaged output files, each with the reason; all were written again."""
