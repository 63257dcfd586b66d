"""Report an autonomous search flight: path, found tags, decisions, and tags not found."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from uavrt.analysis.estimates.position_words import FactTable, place_in_words
from uavrt.analysis.measure.pulse_shapes import point_of
from uavrt.analysis.report.report_maps import LocalMap, draw_track, finish_legend
from uavrt.analysis.report.report_words import Table, title_of, zones
from uavrt.analysis.report.style import SOFT, tag_color
from uavrt.analysis.survey import Survey
from uavrt.core.messages import SearchNote, SoughtTag

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

CAPTION = (
    "The search. Dotted: search area; grey: flight path; small dots: decisions where to fly "
    "next. Stars: found tags, each with its 95 % circle. Squares: probable positions of tags "
    "that were not found; darker is more probable."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FlownSearch:
    """Log entries of one autonomous search, in order of time."""

    notes: tuple[SearchNote, ...]

    @property
    def begun(self) -> SearchNote:
        """Log entry for the start of the search."""
        return self.notes[0]

    @property
    def last(self) -> SearchNote:
        """Log entry of the search's end, or the last one if the recording ends earlier."""
        return self.notes[-1]

    @property
    def decisions(self) -> list[SearchNote]:
        """Log entries for decisions about where to fly next."""
        return [note for note in self.notes if note.event == "decision"]

    @property
    def unknown(self) -> list[SoughtTag]:
        """Tags that were not found, as listed in the last log entry."""
        return [one for one in self.last.tags if one.found_s is None]


def searches_of(survey: Survey) -> Iterator[FlownSearch]:
    """Yield the log entries of each autonomous search in a flight."""
    notes = sorted(survey.search_notes, key=attrgetter("order_id"))
    groups = [tuple(own) for _, own in groupby(notes, key=attrgetter("order_id"))]
    for own in sorted(groups, key=lambda one: one[0].time_ns):
        yield FlownSearch(notes=own)


def summary(survey: Survey, search: FlownSearch) -> FactTable:
    """Table of a search's task and end, tags found, and where the others may be."""
    begun, last, clock = search.begun, search.last, survey.facts.clock_in_words
    minutes = last.elapsed_s / 60.0
    found = len(last.tags) - len(search.unknown)
    each = f", {minutes / found:.1f} minutes for each animal" if found else ""
    ended = last.reason if last.event == "ended" else "the recording ends early"
    return FactTable(
        rows=(
            ("Begun", (f"{clock(begun.time_ns)}: {begun.text}",)),
            ("Ended", (f"{clock(last.time_ns)}: {ended}",)),
            ("Found", (f"{found} of {len(last.tags)} in {minutes:.1f} minutes{each}",)),
            *((f"Tag {title_of(survey, one.tag_id)}", _unknown(one)) for one in search.unknown),
        ),
        details=(("Planner", (begun.reason,)),),
    )


def _unknown(one: SoughtTag) -> list[str]:
    lines = [
        f"not found: detected {one.pulses} times, {one.missed} times not",
        f"in the area and beeping with {100 * one.existence:.0f} %",
    ]
    if one.likely:
        squares = ", ".join(
            f"{latitude:.5f}, {longitude:.5f} ({100 * share:.0f} %)"
            for latitude, longitude, share in one.likely[:3]
        )
        lines.append(f"if so, most probably around {squares}")
    return lines


def found_table(survey: Survey, search: FlownSearch) -> Table:
    """Table of all tags that were searched for, with the minutes until each was found."""
    header = ["Tag", "Found", "Place", "95 % within", "There", "Heard / not"]
    rows = []
    for one in search.last.tags:
        minutes = None if one.found_s is None else one.found_s / 60.0
        rows.append(
            [
                title_of(survey, one.tag_id),
                "no" if minutes is None else f"after {minutes:.1f} min",
                place_in_words(one),
                f"{one.radius95_m:.0f} m",
                f"{100 * one.existence:.0f} %",
                f"{one.pulses} / {one.missed}",
            ]
        )
    return header, rows


def decision_table(survey: Survey, search: FlownSearch) -> Table:
    """Table of all decisions and finds, with the reason for each."""
    rows = [
        [survey.facts.clock(note.time_ns), note.text, note.reason]
        for note in search.notes
        if note.event in ("decision", "found")
    ]
    return [f"Time {zones(survey)}", "Decision", "Reason"], rows


def draw_search(target: "FigureBase", survey: Survey, search: FlownSearch) -> None:
    """Draw search area, path, decisions, found tags, and where the tags not found may be."""
    axes = target.subplots()
    corners = [(longitude, latitude) for latitude, longitude in search.begun.area]
    chart = LocalMap(axes, survey, (), also=corners)
    if corners:
        x, y = chart.line([*corners, corners[0]])
        axes.plot(x, y, color=SOFT, lw=1.0, ls=":", zorder=2, label="area")
    draw_track(chart, survey)
    x, y = chart.line(map(point_of, search.notes))
    axes.plot(x, y, ".", color=SOFT, ms=4, zorder=3)
    for one in search.last.tags:
        color = tag_color(survey.tag_ids, one.tag_id)
        (_draw_unknown if one.found_s is None else _draw_found)(chart, survey, one, color)
    finish_legend(axes)


def _draw_found(chart: LocalMap, survey: Survey, one: SoughtTag, color: str) -> None:
    (x,), (y,) = chart.line([point_of(one)])
    angle = np.linspace(0.0, 2.0 * np.pi, 61)
    circle = x + one.radius95_m * np.cos(angle), y + one.radius95_m * np.sin(angle)
    chart.axes.plot(*circle, color=color, lw=1.3, zorder=5)
    name = f"{survey.label(one.tag_id)}, found"
    chart.axes.plot([x], [y], "*", color=color, ms=13, mec="white", zorder=6, label=name)


def _draw_unknown(chart: LocalMap, survey: Survey, one: SoughtTag, color: str) -> None:
    if not one.likely:
        return
    most = max(share for *_, share in one.likely)
    for number, (latitude, longitude, share) in enumerate(one.likely):
        (x,), (y,) = chart.line([(longitude, latitude)])
        name = f"{survey.label(one.tag_id)}, perhaps" if number == 0 else None
        alpha = 0.6 * share / most
        chart.axes.plot([x], [y], "s", color=color, ms=9, alpha=alpha, zorder=3, label=name)
