"""List the contents of the report as blocks, which `report_page` and `document` lay out."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import uavrt
from uavrt.analysis.covered.silence import SilentMap
from uavrt.analysis.estimates.position_words import FactTable
from uavrt.analysis.report import fold_page as folds
from uavrt.analysis.report import report_heights as heights
from uavrt.analysis.report import report_maps as maps
from uavrt.analysis.report import report_times as times
from uavrt.analysis.report import report_words as words
from uavrt.analysis.report import roses, searches, silences
from uavrt.analysis.report.report_ground import maps_under
from uavrt.analysis.report.style import INK, tag_color
from uavrt.analysis.survey import Survey
from uavrt.flight.integrated import FlightFold


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A heading or a paragraph of text; a section heading begins a new page of the PDF."""

    text: str
    kind: Literal["title", "section", "heading", "plain", "soft", "small", "warning"] = "plain"
    color: str = INK


@dataclass(frozen=True, slots=True)
class Cards:
    """Row of boxes, one per tag, each with the tag's position in words and its color."""

    cards: tuple[tuple[words.Finding, str], ...]


@dataclass(frozen=True, slots=True)
class Grid:
    """Table with relative column widths; with a title `folded`, HTML shows it collapsed."""

    table: words.Table
    widths: tuple[int, ...]
    folded: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure of `WIDTH_IN` by `height_in` inches, which ``draw(figure, *of)`` draws."""

    name: str
    height_in: float
    draw: Callable[..., None]
    of: tuple[Any, ...]
    caption: str = ""


Block = Paragraph | FactTable | Cards | Grid | Picture


def all_blocks(survey: Survey) -> Iterator[Block]:
    """Yield all blocks of the report, in order."""
    yield Paragraph(survey.name, "title")
    for text in (words.heading_line(survey), *survey.facts.lines):
        yield Paragraph(text, "soft")
    for text in survey.warnings:
        yield Paragraph(text, "warning")
    yield Cards(
        tuple((one, tag_color(survey.tag_ids, one.tag_id)) for one in words.findings(survey))
    )
    yield Paragraph("Tags", "heading")
    yield Grid(words.tag_table(survey), (15, 10, 10, 7, 10, 19, 11, 8))
    if (codes := words.code_table(survey)) is not None:
        yield Grid(codes, (15, 30, 30, 14))
    yield Paragraph("Map", "heading")
    name = "Map of the flight with bearings and positions"
    height_in = 6.4 if survey.track else 1.2
    yield Picture(name, height_in, maps.draw_overview, (survey,), maps.CAPTION)
    for search in searches.searches_of(survey):
        yield from _search(survey, search)
    for tag_id in survey.tag_ids:
        if survey.pulses_of(tag_id):
            yield from _tag(survey, tag_id)
    for fold in survey.folds:
        yield from _fold(survey, fold)
    for silence in survey.silences:
        yield from _silence(survey, silence)
    yield from _system(survey)
    yield Paragraph("Methods", "heading")
    for text in words.methods(survey):
        yield Paragraph(text)
    credits_ = (f"Map: {one.credit}" for one in maps_under(survey))
    for text in (*words.SOURCES, *credits_, f"uavrt {uavrt.__version__}"):
        yield Paragraph(text, "small")


def _search(survey: Survey, search: searches.FlownSearch) -> Iterator[Block]:
    yield Paragraph("Autonomous search", "section")
    yield searches.summary(survey, search)
    yield Grid(searches.found_table(survey, search), (20, 16, 24, 12, 9, 11))
    of = survey, search
    yield Picture("Map of the search", 6.0, searches.draw_search, of, searches.CAPTION)
    title = f"{len(search.decisions)} decisions and their reasons"
    yield Grid(searches.decision_table(survey, search), (11, 24, 57), title)


def _tag(survey: Survey, tag_id: int) -> Iterator[Block]:
    name, signal = f"Tag {words.title_of(survey, tag_id)}", survey.signal_of(tag_id)
    of = survey, tag_id
    yield Paragraph(name, "section", tag_color(survey.tag_ids, tag_id))
    if any(one.pose is not None for one in survey.pulses_of(tag_id)):
        caption = maps.TAG_CAPTION if signal is None else maps.SIGNAL_CAPTION
        yield Picture(f"Map of {name}", 4.9, maps.draw_tag_map, of, caption)
        if signal is not None:
            title = f"SNR of {name} over height"
            yield Picture(title, 2.8, heights.draw_heights, (signal,), heights.CAPTION)
            title = f"Maps of {name} by height"
            for first in range(0, len(signal.layers), heights.PER_PAGE):
                rows = -(-min(heights.PER_PAGE, len(signal.layers) - first) // heights.COLUMNS)
                layers, caption = (survey, signal, first), heights.LAYER_CAPTION
                yield Picture(title, 3.4 * rows, heights.draw_layers, layers, caption)
    for first in range(0, len(survey.bearings_of(tag_id)), roses.COLUMNS):
        title = f"Roses of {name}"
        yield Picture(title, 3.3, roses.draw_roses, (*of, first), roses.CAPTION)
    yield Picture(f"SNR of {name} and heading over time", 2.4, times.draw_times, of)


def _fold(survey: Survey, fold: FlightFold) -> Iterator[Block]:
    title = f"Tag {words.title_of(survey, fold.tag_id)} over the whole flight"
    yield Paragraph(title, "section")
    yield words.hindsight(survey, fold.tag_id)
    of = fold, tag_color(survey.tag_ids, fold.tag_id)
    yield Picture(f"{title}: folded", 4.6, folds.draw_fold, of, folds.CAPTION)


def _silence(survey: Survey, one: SilentMap) -> Iterator[Block]:
    title = f"Where tag {words.title_of(survey, one.tag_id)} would be detected"
    yield Paragraph(title, "section")
    yield silences.summary(one)
    yield Picture(title, 6.4, silences.draw_silence, (survey, one), silences.CAPTION)


def _system(survey: Survey) -> Iterator[Block]:
    if survey.bearings:
        yield Paragraph("Bearings", "section")
        yield Grid(words.bearing_table(survey), (6, 11, 22, 8, 15, 7, 23))
    if (beeps := words.beep_table(survey)) is not None:
        yield Paragraph("Other beeping signals", "heading")
        yield Grid(beeps, (10, 11, 9, 7, 5, 50))
    events = words.events(survey)
    if survey.health or survey.search_reports or events:
        yield Paragraph("System", "heading")
    if survey.health:
        yield Grid(words.health_table(survey), (14, 18, 18, 42))
    if survey.search_reports:
        of = (survey,)
        yield Picture("Noise over time", 2.3, times.draw_noise, of, times.NOISE_CAPTION)
    if events:
        yield Grid(([f"Time {words.zones(survey)}", "Event"], events), (11, 81))
