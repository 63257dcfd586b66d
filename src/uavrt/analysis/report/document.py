"""Make the report as PDF: A4 pages for print and mail."""

import io
from typing import TYPE_CHECKING

from uavrt.analysis.covered.silence import SilentMap
from uavrt.analysis.report import fold_page as folds
from uavrt.analysis.report import report_heights as heights
from uavrt.analysis.report import report_maps as maps
from uavrt.analysis.report import report_times as times
from uavrt.analysis.report import report_words as words
from uavrt.analysis.report import roses, searches, silences
from uavrt.analysis.report.style import (
    A4_IN,
    FAINT,
    SOFT,
    new_figure,
    styled,
    tag_color,
    wrapped,
)
from uavrt.analysis.survey import Survey
from uavrt.flight.integrated import FlightFold

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure, FigureBase

_LEFT, _RIGHT, _TOP, _BOTTOM = 0.08, 0.93, 0.95, 0.06
_WIDTH_IN = (_RIGHT - _LEFT) * A4_IN[0]
_BETWEEN_IN = 0.06
_LINE = 0.0155
"""Line height of 9-point text, with spacing, as a share of the page's height."""


def pdf_document(survey: Survey) -> bytes:
    """Make the report's PDF; raises `UsageError` without matplotlib."""
    with styled():
        from matplotlib.backends.backend_pdf import PdfPages

        stream = io.BytesIO()
        with PdfPages(stream, metadata={"Title": survey.name, "CreationDate": None}) as pages:
            book = _Book(pages, survey)
            book.first_page()
            for search in searches.searches_of(survey):
                book.search_pages(search)
            for tag_id in survey.tag_ids:
                if survey.pulses_of(tag_id):
                    book.tag_page(tag_id)
            for fold in survey.folds:
                book.fold_page(fold)
            for one in survey.silences:
                book.silence_page(one)
            book.last_pages()
        return stream.getvalue()


class _Book:
    def __init__(self, pages: "PdfPages", survey: Survey) -> None:
        self._pages = pages
        self._survey = survey
        self._number = 0

    def first_page(self) -> None:
        survey = self._survey
        writer = _Writer(self)
        writer.text(survey.name, size=16, weight="bold")
        for text in (words.heading_line(survey), *survey.facts.lines):
            writer.text(text, color=SOFT)
        writer.skip()
        for warning in survey.warnings:
            writer.text(f"! {warning}", color="#8a5a00")
        for one in words.findings(survey):
            writer.skip(0.5)
            color = tag_color(survey.tag_ids, one.tag_id)
            place = "" if one.place is None else f" · {one.place}"
            writer.text(one.title + place, size=11, weight="bold", color=color)
            writer.text(one.detail)
        if writer.left < 0.42:
            writer.end_page()
        height = min(0.62, writer.left - 0.02)
        figure = writer.figure
        part = _part(figure, _BOTTOM, height)
        maps.draw_overview(part, survey)
        writer.end_page()

    def search_pages(self, search: searches.FlownSearch) -> None:
        survey = self._survey
        writer = _Writer(self)
        writer.text("Search by the drone itself", size=14, weight="bold")
        for text in searches.sentences(survey, search):
            writer.text(text)
            writer.skip(0.3)
        table = searches.found_table(survey, search)
        writer.table("Tags", table, (20, 16, 24, 12, 9, 11))
        writer.room(0.42)
        height = min(0.55, writer.left - 0.02)
        searches.draw_search(_part(writer.figure, _BOTTOM, height), survey, search)
        writer.end_page()
        writer.table("Decisions", searches.decision_table(survey, search), (11, 24, 57))
        writer.end_page()

    def tag_page(self, tag_id: int) -> None:
        survey = self._survey
        figure = self.page()
        title = f"Tag {words.title_of(survey, tag_id)}"
        color = tag_color(survey.tag_ids, tag_id)
        top = _headed(figure, title, color, bold=True)
        maps.draw_tag_map(_part(figure, 0.53, top - 0.53), survey, tag_id)
        signal = survey.signal_of(tag_id)
        if signal is not None:
            heights.draw_heights(_part(figure, 0.27, 0.25), signal)
        else:
            roses.draw_roses(_part(figure, 0.27, 0.25), survey, tag_id)
        times.draw_times(_part(figure, _BOTTOM, 0.20), survey, [tag_id])
        self.save(figure)
        layers = 0 if signal is None else len(signal.layers)
        for first in range(0, layers, heights.PER_PAGE):
            figure = self.page()
            top = _headed(figure, f"{title}, by height", color)
            rows = -(-min(heights.PER_PAGE, layers - first) // heights.COLUMNS)
            assert signal is not None
            height = min(0.28 * rows, top - _BOTTOM)
            part = _part(figure, top - height, height)
            heights.draw_layers(part, survey, signal, first)
            self.save(figure)
        count = len(survey.bearings_of(tag_id))
        rest = list(range(roses.COLUMNS, count, roses.COLUMNS))
        for start in range(0, len(rest), 3):
            figure = self.page()
            top = _headed(figure, f"{title}, further turns", color)
            for row, first in enumerate(rest[start : start + 3]):
                bottom = top - 0.27 - 0.285 * row
                roses.draw_roses(_part(figure, bottom, 0.27), survey, tag_id, first)
            self.save(figure)

    def fold_page(self, one: FlightFold) -> None:
        survey = self._survey
        writer = _Writer(self)
        title = f"Tag {words.title_of(survey, one.tag_id)} over the whole flight"
        writer.text(title, size=14, weight="bold")
        for text in (*words.hindsight(survey, one.tag_id), folds.CAPTION):
            writer.text(text)
            writer.skip(0.3)
        height = min(0.45, writer.left - 0.02)
        part = _part(writer.figure, writer.top - 0.02 - height, height)
        folds.draw_fold(part, one, tag_color(survey.tag_ids, one.tag_id))
        writer.end_page()

    def silence_page(self, one: SilentMap) -> None:
        survey = self._survey
        writer = _Writer(self)
        title = f"Where tag {words.title_of(survey, one.tag_id)} would be detected"
        writer.text(title, size=14, weight="bold")
        for text in (*silences.sentences(survey, one), silences.CAPTION):
            writer.text(text)
            writer.skip(0.3)
        height = min(0.6, writer.left - 0.02)
        silences.draw_silence(_part(writer.figure, _BOTTOM, height), survey, one)
        writer.end_page()

    def last_pages(self) -> None:
        survey = self._survey
        writer = _Writer(self)
        writer.table("Tags", words.tag_table(survey), (15, 10, 10, 7, 10, 19, 11, 8))
        if (codes := words.code_table(survey)) is not None:
            writer.table("Codes", codes, (15, 30, 30, 14))
        if survey.bearings:
            widths = (6, 11, 22, 8, 15, 7, 23)
            writer.table("Bearings", words.bearing_table(survey), widths)
        if (beeps := words.beep_table(survey)) is not None:
            writer.table("What else beeped", beeps, (10, 11, 9, 7, 5, 50))
        if survey.health:
            writer.table("System", words.health_table(survey), (14, 18, 18, 42))
        if events := words.events(survey):
            rows = [[time, text] for time, text in events]
            writer.table("Events", ([f"Time {words.zones(survey)}", "Event"], rows), (11, 81))
        if survey.search_reports:
            writer.room(0.2)
            times.draw_noise(_part(writer.figure, writer.top - 0.17, 0.16), survey)
            writer.skip(12)
        writer.room(0.05)
        writer.text("Methods", size=12, weight="bold")
        for text in words.methods(survey):
            writer.text(text)
            writer.skip(0.3)
        for text in words.SOURCES:
            writer.text(text, color=SOFT)
        writer.text(words.made_by(), color=SOFT)
        writer.end_page()

    def page(self) -> "Figure":
        return new_figure(*A4_IN)

    def save(self, figure: "Figure") -> None:
        self._number += 1
        figure.text(_RIGHT, 0.025, str(self._number), ha="right", color=SOFT, size=8)
        name, *more = wrapped(self._survey.name, _WIDTH_IN - 0.5, size=8)
        figure.text(_LEFT, 0.025, f"{name} …" if more else name, color=SOFT, size=8)
        self._pages.savefig(figure)  # type: ignore[no-untyped-call]


class _Writer:
    """Writes text down a page, and continues on the next one."""

    def __init__(self, book: _Book) -> None:
        self._book = book
        self.figure = book.page()
        self.top = _TOP

    @property
    def left(self) -> float:
        return self.top - _BOTTOM

    def text(
        self, text: str, *, size: float = 9, weight: str = "normal", color: str = "#1b2430"
    ) -> None:
        for line in wrapped(text, _WIDTH_IN, size=size, bold=weight == "bold"):
            self.room(_LINE * size / 9)
            self.figure.text(
                _LEFT, self.top, line, size=size, weight=weight, color=color, va="top"
            )
            self.top -= _LINE * size / 9

    def skip(self, lines: float = 1.0) -> None:
        self.top -= lines * _LINE

    def room(self, height: float) -> None:
        """Start a new page unless the current one has enough room."""
        if self.left < height:
            self.end_page()
            self.figure = self._book.page()

    def table(self, title: str, table: words.Table, widths: tuple[int, ...]) -> None:
        header, rows = table
        self.room(5 * _LINE)
        self.text(title, size=12, weight="bold")
        self._row(header, widths, color=SOFT)
        for row in rows:
            self._row(row, widths)
        self.skip()

    def _row(self, cells: list[str], widths: tuple[int, ...], color: str = "#1b2430") -> None:
        scale = (_RIGHT - _LEFT) / sum(widths)
        texts = [
            wrapped(cell, width * scale * A4_IN[0] - _BETWEEN_IN, size=8)
            for cell, width in zip(cells, widths, strict=True)
        ]
        lines = max(map(len, texts))
        self.room(lines * _LINE)
        left = _LEFT
        for text, width in zip(texts, widths, strict=True):
            for number, line in enumerate(text):
                y = self.top - number * _LINE * 0.9
                self.figure.text(left, y, line, size=8, color=color, va="top")
            left += width * scale
        self.top -= lines * _LINE * 0.9 + 0.2 * _LINE
        self.figure.add_artist(_rule(self.top))
        self.top -= 0.2 * _LINE

    def end_page(self) -> None:
        self._book.save(self.figure)
        self.figure = self._book.page()
        self.top = _TOP


def _headed(figure: "Figure", title: str, color: str, *, bold: bool = False) -> float:
    """Write a page's title; returns the height below it, as a share of the page's height."""
    lines = wrapped(title, _WIDTH_IN, size=14, bold=bold)
    weight = "bold" if bold else "normal"
    for number, line in enumerate(lines):
        y = _TOP - number * _LINE * 14 / 9
        figure.text(_LEFT, y, line, size=14, weight=weight, va="top", color=color)
    return _TOP - len(lines) * _LINE * 14 / 9 - 0.016


def _rule(height: float) -> "Artist":
    from matplotlib.lines import Line2D

    return Line2D([_LEFT, _RIGHT], [height, height], color=FAINT, lw=0.5)


def _part(figure: "Figure", bottom: float, height: float) -> "FigureBase":
    """Axes between the page's margins; heights are shares of the page's height."""
    grid = figure.add_gridspec(
        3,
        3,
        height_ratios=[1.0 - bottom - height, height, bottom],
        width_ratios=[_LEFT, _RIGHT - _LEFT, 1.0 - _RIGHT],
    )
    return figure.add_subfigure(grid[1, 1])
