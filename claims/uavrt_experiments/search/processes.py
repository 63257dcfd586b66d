"""Several searches by the real processes, whose pulses come from samples.

Each flight is one of `uavrt demo --search` in a world drawn from the seed: supervisor,
processes and order are those of a flight; radio and autopilot are simulated. A failed flight is
stored with its reason.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import UavrtError
from uavrt.core.units import wrap_degrees_360
from uavrt.simulation.demo.demo_search import SearchDemo, SearchSummary
from uavrt.simulation.demo.worlds import search_world
from uavrt.simulation.scene.scenario import Scenario
from uavrt_experiments.figures import mean, measured, share
from uavrt_experiments.kept import KeptOutcomes
from uavrt_experiments.result import Row
from uavrt_experiments.search.table import figure_text
from uavrt_experiments.statistics import Figure
from uavrt_experiments.tables import aligned, markdown

PROCESSES = "processes"
"""Name of the table of searches by real processes."""
PROCESS_FOLDERS = ("detection", "dsp", "guidance", "localization", "planning")
"""Folders of the package whose code the figures depend on."""
LIMIT_S = 600.0
"""Time limit of each search [s], as in the demo."""
_FALSE_RADII = 3.0
"""Error, in 95 % radii, beyond which a find counts as false."""
_CASE = "mi_rate, our stop"
_HEADS = (
    *("seed", "found", "time, s", "error of each animal, m (95 % radius)"),
    *("decisions", "commands", "found falsely", "guide, CPU, %", "guide, MB"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RealFlight:
    """Result of one search by the real processes."""

    seed: int
    animals: int
    """Number of animals present."""
    summary: SearchSummary | None = None
    """The demo's summary of the flight; None: the flight failed."""
    failure: str = ""

    @property
    def found(self) -> int:
        """Number of animals found."""
        return 0 if self.summary is None else sum(a.found for a in self.summary.tags.values())

    @property
    def time_s(self) -> float:
        """Time until all animals were found [s]; the limit if they were not."""
        if self.summary is None or self.found < self.animals:
            return LIMIT_S
        return max(one.found_s or 0.0 for one in self.summary.tags.values())

    @property
    def errors(self) -> list[tuple[float, float]]:
        """Error and 95 % radius [m] of each found animal."""
        animals = () if self.summary is None else self.summary.tags.values()
        return [(one.error_m, one.radius95_m) for one in animals if one.error_m is not None]

    @property
    def false_finds(self) -> int:
        """Number of animals reported at a wrong place."""
        return sum(error > _FALSE_RADII * radius for error, radius in self.errors)


def drawn_world(seed: int) -> Scenario:
    """The demo's world with each animal rotated about home by a random angle.

    `seed`: seed of the angles and of everything random in the world.
    """
    world = search_world(None, limit_s=LIMIT_S, seed=seed, coded=False)
    turns = np.random.default_rng((seed, 5)).uniform(0.0, 360.0, len(world.tag))
    return replace(
        world,
        tag=tuple(
            replace(
                tag,
                north_m=round(tag.north_m * math.cos(a) - tag.east_m * math.sin(a), 1),
                east_m=round(tag.north_m * math.sin(a) + tag.east_m * math.cos(a), 1),
                heading_deg=float(wrap_degrees_360(tag.heading_deg + math.degrees(a))),
            )
            for tag, a in zip(world.tag, np.radians(turns), strict=True)
        ),
    )


def fly_for_real(
    flights: int,
    seed: int,
    *,
    kept: KeptOutcomes,
    say: Callable[[str], None],
    on_progress: Callable[[int], None],
) -> None:
    """Fly searches one after another, and store each result.

    `seed`: seed of the first; each following one has the next.
    `kept`: stored flights are not flown again.
    `say`: receives a line of progress.
    `on_progress`: receives the number of flights done.
    """
    for number in range(flights):
        kept.take(_name(seed + number), partial(_flown, drawn_world(seed + number), say))
        on_progress(number + 1)


def flights_so_far(flights: int, seed: int, kept: KeptOutcomes) -> list[RealFlight]:
    """Stored results of `fly_for_real`."""
    stored = [one for n in range(flights) for one in kept.of(_name(seed + n))]
    return [msgspec.convert(one, RealFlight) for one in stored]


def _name(seed: int) -> str:
    return f"{PROCESSES} {seed};"


def _flown(world: Scenario, say: Callable[[str], None]) -> dict[str, Any]:
    """Fly one search; its recording is deleted."""
    summary, failure = None, ""
    with TemporaryDirectory(prefix="uavrt-searches-") as work:
        try:
            place = Path(work)
            demo = SearchDemo(scenario=world, limit_s=LIMIT_S, flight_dir=place, say=say)
            summary = demo.run()
        except (UavrtError, OSError) as error:
            failure = str(error)
    return asdict(
        RealFlight(
            seed=world.seed,
            animals=len(world.tags),
            summary=None if summary is None else replace(summary, flight_directory=""),
            failure=failure,
        )
    )


# ---------------------------------------------------------------------- the table


def largest(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest value over all flights."""
    return np.asarray(np.max(values, axis=-1))


def process_rows(flights: Sequence[RealFlight]) -> list[Row]:
    """Rows of the figures over all flights, with their requirements.

    `flights`: a failed one counts as having found no animals.
    """
    found = [float(n < one.found) for one in flights for n in range(one.animals)]
    errors = [pair for one in flights for pair in one.errors]
    summaries = [one.summary for one in flights if one.summary is not None]
    false = [float(error > _FALSE_RADII * radius) for error, radius in errors]

    def row(
        quantity: str,
        values: Sequence[float],
        figure: Figure,
        *,
        least: float | None = None,
        most: float | None = None,
    ) -> Row:
        return measured(PROCESSES, _CASE, quantity, values, figure, least=least, most=most)

    return [
        row("flights that failed, share", [float(f.summary is None) for f in flights], share),
        row("animals found, share", found, share, least=1.0),
        row("time, mean, s", [one.time_s for one in flights], mean),
        row("error, mean, m", [error for error, _ in errors], mean),
        row("95 % circle holds, share", [float(error <= r) for error, r in errors], share),
        row("found falsely, share", false, share, most=0.01),
        row("decisions, mean", [float(one.decisions) for one in summaries], mean),
        row("commands, mean", [float(one.commands) for one in summaries], mean),
        row("guide, CPU, most, %", [s.guide_cpu_percent for s in summaries], largest, most=5.0),
        row("guide, most, MB", [s.guide_memory_mb for s in summaries], largest, most=80.0),
    ]


def flight_lines(flights: Sequence[RealFlight]) -> tuple[list[str], list[list[str]]]:
    """Headings, and a line of text for each flight; a failed one has the reason."""
    lines = []
    for one in flights:
        line = [str(one.seed), f"{one.found} of {one.animals}"]
        if one.summary is None:
            reason = " ".join(one.failure.split())
            lines.append([*line, "", f"failed: {reason}", *[""] * (len(_HEADS) - 4)])
            continue
        errors = ", ".join(
            "–" if animal.error_m is None else f"{animal.error_m:.1f} ({animal.radius95_m:.0f})"
            for animal in one.summary.tags.values()
        )
        counts = one.summary.decisions, one.summary.commands, one.false_finds
        lines.append(
            [
                *(*line, f"{one.time_s:.0f}", errors, *map(str, counts)),
                f"{one.summary.guide_cpu_percent:.1f}",
                f"{one.summary.guide_memory_mb:.0f}",
            ]
        )
    return list(_HEADS), lines


def _figure_lines(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    heads = ["", "asked", "reached (95 %)", "of"]
    return heads, [[one.quantity, one.bar, figure_text(one), str(one.n)] for one in rows]


def process_section(flights: Sequence[RealFlight], rows: Sequence[Row]) -> str:
    """Format the flights and their figures for a terminal."""
    parts = (flight_lines(flights), _figure_lines(rows))
    return "\n\n".join(aligned([heads, *lines]) for heads, lines in parts)


def process_page(
    flights: Sequence[RealFlight], rows: Sequence[Row], command: str, code: str
) -> str:
    """Format the flights and their figures as Markdown; figures that miss their requirement are
    bold.

    `rows`: as `process_rows` makes them.
    `command`, `code`: command that repeats the table, and line about the code.
    """
    heads, lines = _figure_lines(rows)
    for line, one in zip(lines, rows, strict=True):
        line[2] = line[2] if one.met else f"**{line[2]}**"
    parts = [f"## {PROCESSES}: Searches by the real processes"]
    parts += [f"Command: `{command}`", code]
    for names, cells in (flight_lines(flights), (heads, lines)):
        parts.append(markdown((names, *cells)))
    return "\n\n".join(parts)
