"""Searches by the real processes as a table: from recorded summaries, none is flown here."""

import json
import math
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from uavrt.core.errors import UavrtError
from uavrt.simulation.demo.demo_search import SearchSummary, SoughtAnimal
from uavrt_experiments.kept import KeptOutcomes
from uavrt_experiments.search import processes
from uavrt_experiments.search.page import put_section
from uavrt_experiments.search.processes import (
    LIMIT_S,
    PROCESSES,
    RealFlight,
    drawn_world,
    flights_so_far,
    fly_for_real,
    process_page,
    process_rows,
    process_section,
)


def animal(
    found_s: float | None, error_m: float = 12.8, radius95_m: float = 18.0
) -> SoughtAnimal:
    return SoughtAnimal(
        name="lynx",
        found=found_s is not None,
        found_s=found_s,
        error_m=None if found_s is None else error_m,
        radius95_m=radius95_m,
        walked_m=0.0,
        pulses=60,
        latitude_deg=46.0,
        longitude_deg=10.0,
    )


def flight(seed: int, *animals: SoughtAnimal) -> RealFlight:
    """As `uavrt demo --search --seed 1` told of its guide and its commands."""
    summary = SearchSummary(
        tags={str(number): one for number, one in enumerate(animals)},
        ended="every tag is found",
        duration_s=260.0,
        decisions=38,
        commands=86,
        guide_cpu_percent=1.3,
        guide_memory_mb=69.9,
        flight_directory="",
    )
    return RealFlight(seed=seed, animals=len(animals), summary=summary)


ALL_FOUND = flight(1, animal(110.0), animal(252.0, 4.3, 25.0))
ONE_MISSED = flight(2, animal(150.0, 90.0, 20.0), animal(None))
FAILED = RealFlight(seed=3, animals=2, failure="the search did not end.\nRun it again")


def test_a_failed_flight_counts_as_having_found_nothing_in_all_its_time() -> None:
    rows = {one.quantity: one for one in process_rows([ALL_FOUND, ONE_MISSED, FAILED])}
    assert rows["flights that failed, share"].figure == pytest.approx(1.0 / 3.0)
    assert (rows["animals found, share"].n, rows["animals found, share"].figure) == (6, 0.5)
    assert not rows["animals found, share"].met
    assert rows["time, mean, s"].figure == pytest.approx((252.0 + 2.0 * LIMIT_S) / 3.0)
    assert rows["decisions, mean"].n == 2


def test_an_animal_that_is_far_from_where_it_was_said_to_be_is_found_falsely() -> None:
    assert (ALL_FOUND.false_finds, ONE_MISSED.false_finds) == (0, 1)
    rows = {one.quantity: one for one in process_rows([ALL_FOUND, ONE_MISSED])}
    assert rows["found falsely, share"].figure == pytest.approx(1.0 / 3.0)
    assert rows["found falsely, share"].contradicted or not rows["found falsely, share"].met
    assert rows["95 % circle holds, share"].figure == pytest.approx(2.0 / 3.0)


def test_the_guide_keeps_its_budget_in_every_flight_or_misses_the_bar() -> None:
    assert ONE_MISSED.summary is not None
    hungry = replace(ONE_MISSED, summary=replace(ONE_MISSED.summary, guide_cpu_percent=5.4))
    for flights, met in (([ALL_FOUND, ONE_MISSED], True), ([ALL_FOUND, hungry], False)):
        rows = {one.quantity: one for one in process_rows(flights)}
        assert rows["guide, CPU, most, %"].met is met
        assert rows["guide, most, MB"].met


def test_all_flights_that_failed_miss_every_bar() -> None:
    assert not any(one.met for one in process_rows([FAILED]) if one.barred)


def test_each_flight_has_its_line_and_a_failed_one_its_reason() -> None:
    flights = [ALL_FOUND, ONE_MISSED, FAILED]
    text = process_section(flights, process_rows(flights))
    first, second, third = text.splitlines()[1:4]
    assert " ".join(first.split()) == "1 2 of 2 252 12.8 (18), 4.3 (25) 38 86 0 1.3 70"
    assert " ".join(second.split()) == "2 1 of 2 600 90.0 (20), – 38 86 1 1.3 70"
    assert third.endswith("failed: the search did not end. Run it again")


def test_the_table_stands_behind_the_others_on_the_page_in_place_of_its_earlier_one(
    tmp_path: Path,
) -> None:
    page = tmp_path / "bars.md"
    page.write_text("# Bars\n\nWords.\n", encoding="utf-8")
    flights = [ALL_FOUND, ONE_MISSED, FAILED]
    rows = process_rows(flights)
    put_section(page, PROCESSES, process_page(flights, rows, "first", "Measured now."))
    for name in ("T10", "T9"):
        put_section(page, name, f"## {name}: other")
    put_section(page, PROCESSES, process_page(flights, rows, "second", "Measured now."))
    written = page.read_text(encoding="utf-8")
    assert written.startswith("# Bars\n\nWords.\n")
    assert "`first`" not in written
    marks = [f"<!-- begin {name} -->" for name in ("T9", "T10", "processes")]
    assert sorted(marks, key=written.index) == marks
    assert "**0.5 (0.188–0.812)**" in written
    tables = [line for line in written.splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in tables[:5]}) == 1


def test_flights_that_are_kept_are_not_flown_again(tmp_path: Path) -> None:
    kept = tmp_path / "kept.jsonl"
    told = [
        {"made_with": "this code"},
        *(
            {"trial": f"{PROCESSES} {one.seed};", "outcome": asdict(one)}
            for one in (ALL_FOUND, ONE_MISSED, FAILED)
        ),
    ]
    kept.write_text("".join(json.dumps(one) + "\n" for one in told), encoding="utf-8")
    done: list[int] = []
    with KeptOutcomes(kept, made_with="this code") as outcomes:
        fly_for_real(3, 1, kept=outcomes, say=print, on_progress=done.append)
        assert flights_so_far(3, 1, outcomes) == [ALL_FOUND, ONE_MISSED, FAILED]
        assert flights_so_far(9, 2, outcomes) == [ONE_MISSED, FAILED]
    assert done == [1, 2, 3]


@pytest.mark.parametrize(
    "error",
    [
        UavrtError("the search did not end", remedy="Run it again, or report it"),
        FileNotFoundError(2, "the search did not end: its directory is gone"),
    ],
)
def test_a_flight_that_fails_is_kept_with_its_reason_and_the_next_is_flown(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fails(**_: object) -> SearchSummary:
        raise error

    monkeypatch.setattr(processes, "SearchDemo", fails)
    with KeptOutcomes() as outcomes:
        fly_for_real(2, 5, kept=outcomes, say=print, on_progress=lambda done: None)
        flights = flights_so_far(2, 5, outcomes)
    assert [one.seed for one in flights] == [5, 6]
    assert all(one.summary is None and one.animals == 3 for one in flights)
    assert all("the search did not end" in one.failure for one in flights)


def test_each_seed_has_its_animals_elsewhere_but_as_far_from_home() -> None:
    worlds = [drawn_world(seed) for seed in (1, 1, 2)]
    assert worlds[0] == worlds[1]
    places = [[(tag.north_m, tag.east_m) for tag in world.tag] for world in worlds]
    assert all(math.dist(*pair) > 10.0 for pair in zip(places[0], places[2], strict=True))
    away = [[math.hypot(*place) for place in one] for one in places]
    assert away[0] == pytest.approx(away[2], abs=0.2)
    headings = [
        [tag.heading_deg - math.degrees(math.atan2(tag.east_m, tag.north_m)) for tag in w.tag]
        for w in worlds
    ]
    for here, there in zip(headings[0], headings[2], strict=True):
        assert math.cos(math.radians(here - there)) > 0.999
