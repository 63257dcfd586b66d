"""Coverage maps over hills: the share of truly empty areas among those reported empty with 0.94
to 0.96.

Tags are anywhere on the map with equal probability, and their levels vary as the map assumes.
For each tag that a flight does not detect, an area is drawn from those to which the flight's
map gives 0.94 to 0.96 to be empty.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from uavrt.planning.detectability.detection_coverage import Coverage, absence
from uavrt_experiments.coverage.hilly import (
    CELL_M,
    HALF_M,
    SIGMA_DB,
    GroupsOverHills,
    WholeFlightOverHills,
)
from uavrt_experiments.kept import KeptOutcomes
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import share_of

_SAID = (0.94, 0.96)
_AREAS = 100
_TRIED = 60_000
_Area = tuple[float, float, float, float]


class MappedFlight(Protocol):
    """A flight over hills, and its coverage map."""

    @property
    def map(self) -> Coverage:
        """Probability of detecting a tag at each place."""

    def hears(
        self, east_m: float, north_m: float, error_db: float, rng: np.random.Generator
    ) -> bool:
        """True if the flight detects a tag whose level differs by a given amount [dB]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Silence:
    """A method of detecting tags, whose coverage maps are tested."""

    experiment: str
    case: str
    flight: Callable[[np.random.Generator, int], MappedFlight]
    """Makes a flight from a random generator and the flight's number."""


FOLDERS = ("localization/whole_flight", "planning", "localization/terrain")
"""Folders of the package whose code the figures depend on."""
SILENCES = (
    Silence(
        experiment="C1",
        case="groups of pulses",
        flight=lambda rng, number: GroupsOverHills(rng),
    ),
    Silence(experiment="C3", case="whole flights", flight=WholeFlightOverHills),
)


def seek_tags(
    kind: Silence,
    silent: int,
    *,
    kept: KeptOutcomes,
    flights: int = 4,
    seed: int = 1,
    on_tag: Callable[[int], None] = lambda done: None,
) -> None:
    """Draw tags until a number of them was not detected; each result is stored.

    `silent`: required number of undetected tags, over all flights.
    `kept`: stores None for a detected tag, else True if the area drawn was empty.
    `flights`: each over other hills.
    `seed`: seeds everything random, with the flight's and the tag's number.
    `on_tag`: receives the number of undetected tags so far.
    """
    done = 0
    for number in range(flights):
        flight = kind.flight(np.random.default_rng((seed, number)), number)
        areas = probably_empty(flight.map, np.random.default_rng((seed, number, 1)))
        wanted, index = silent * (number + 1) // flights, 0
        while done < wanted:
            rng = np.random.default_rng((seed, number, 2, index))
            name = f"{kind.experiment} {number} {index}"
            empty = kept.take(name, partial(_emptiness, flight, areas, rng))
            done += empty is not None
            index += 1
            on_tag(done)


def _emptiness(
    flight: MappedFlight, areas: list[_Area], rng: np.random.Generator
) -> bool | None:
    """True if an area is empty of the undetected tag; None if the tag is detected."""
    east, north = rng.uniform(-HALF_M, HALF_M, 2)
    if flight.hears(east, north, float(rng.normal(0.0, SIGMA_DB)), rng):
        return None
    west, right, south, top = areas[rng.integers(len(areas))]
    return not (west <= east <= right and south <= north <= top)


def silence_rows(kind: Silence, kept: KeptOutcomes) -> list[Row]:
    """Rows with the share of areas that were empty; none without undetected tags."""
    drawn = kept.of(f"{kind.experiment} ")
    empty = [one for one in drawn if one is not None]
    if not empty:
        return []
    return [
        Row.with_interval(
            kind.experiment,
            "empty share of areas with probability .94 to .96",
            f"{kind.case} over hills, ± {SIGMA_DB:g} dB",
            share_of(sum(empty), len(empty)),
            len(empty),
            least=0.93,
            most=0.97,
            note=f"{len(drawn) - len(empty)} more tags were heard",
        )
    ]


def probably_empty(found: Coverage, rng: np.random.Generator) -> list[_Area]:
    """Rectangles that are probably empty after a flight without a detection: west, east, south,
    north.
    """
    ground = found.ground
    areas: list[_Area] = []
    for _ in range(_TRIED):
        middle = rng.uniform(-HALF_M, HALF_M, 2)
        half = rng.uniform(100.0, 900.0, 2)
        low, high = np.maximum(middle - half, -HALF_M), np.minimum(middle + half, HALF_M)
        inside = (ground.east_m >= low[0]) & (ground.east_m <= high[0])
        cells: NDArray[np.bool_] = (
            inside[np.newaxis, :]
            & ((ground.north_m >= low[1]) & (ground.north_m <= high[1]))[:, np.newaxis]
        )
        if cells.any() and _SAID[0] <= absence(found, cells, None).not_here <= _SAID[1]:
            # The edges of the cells that were counted.
            east, north = ground.east_m[inside], ground.north_m[cells.any(axis=1)]
            areas.append(
                (
                    float(east[0]) - 0.5 * CELL_M,
                    float(east[-1]) + 0.5 * CELL_M,
                    float(north[0]) - 0.5 * CELL_M,
                    float(north[-1]) + 0.5 * CELL_M,
                )
            )
            if len(areas) == _AREAS:
                break
    return areas
