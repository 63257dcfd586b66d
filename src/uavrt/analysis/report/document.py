"""Lay out the report as a PDF of A4 pages, for print and mail."""

import io
from collections.abc import Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING

from uavrt.analysis.estimates.position_words import FactTable, Row
from uavrt.analysis.report import report_blocks as blocks
from uavrt.analysis.report.report_words import Finding
from uavrt.analysis.report.style import (
    A4_IN,
    FAINT,
    INK,
    SOFT,
    WIDTH_IN,
    new_figure,
    styled,
    wrapped,
)
from uavrt.analysis.survey import Survey

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure, FigureBase

_LEFT, _RIGHT, _TOP, _BOTTOM = 0.08, 0.93, 0.95, 0.06
_WIDTH_IN = (_RIGHT - _LEFT) * A4_IN[0]
_BETWEEN_IN = 0.06
_LINE = 0.0155
"""Line height of 9-point text, with spacing, as a share of the page's height."""
_LEAST_SHARE = 0.6
"""Smallest share of its height to which a picture is reduced before it is moved to the next
page."""
_WARNING = "#8a5a00"


def pdf_document(survey: Survey) -> bytes:
    """Return the report as PDF. Raises `UsageError` without matplotlib."""
    with styled():
        from matplotlib.backends.backend_pdf import PdfPages

        stream = io.BytesIO()
        with PdfPages(stream, metadata={"Title": survey.name, "CreationDate": None}) as pages:
            write_pages(pages, survey)
        return stream.getvalue()


def write_pages(pages: "PdfPages", survey: Survey) -> None:
    """Lay out all blocks of the report, and save each page."""
    writer, every = _Writer(pages, survey.name), list(blocks.all_blocks(survey))
    for block, after in zip_longest(every, every[1:]):
        writer.write(block, after)
    writer.end_page()


class _Writer:
    """Writes blocks down a page, and continues on the next page when it is full."""

    def __init__(self, pages: "PdfPages", name: str) -> None:
        self._pages, self._name = pages, name
        self._number = 0
        self._begin_page()

    def write(self, block: blocks.Block, after: blocks.Block | None) -> None:
        """Write a block; a heading is kept on the same page as the block after it."""
        match block:
            case blocks.Paragraph(kind="section" | "heading"):
                self._heading(block, after)
            case blocks.Paragraph(kind="title"):
                self._text(block.text, size=16, bold=True)
            case blocks.Paragraph(kind="plain"):
                self._text(block.text)
                self._skip(0.3)
            case blocks.Paragraph(kind="warning"):
                self._text(f"! {block.text}", color=_WARNING)
            case blocks.Paragraph():
                self._text(block.text, color=SOFT)
            case FactTable():
                self._facts(block)
            case blocks.Grid():
                self._grid(block)
            case blocks.Picture():
                self._picture(block)
            case blocks.Cards():
                for one, color in block.cards:
                    self._card(one, color)

    def _heading(self, heading: blocks.Paragraph, after: blocks.Block | None) -> None:
        begins = heading.kind == "section"
        if begins and self._top < _TOP:
            self.end_page()
            self._begin_page()
        self._room(3 * _LINE + _least_height(after))
        self._skip()
        size = 14 if begins else 12
        self._text(heading.text, size=size, bold=True, color=heading.color)

    def _card(self, one: Finding, color: str) -> None:
        self._skip(0.5)
        self._room(4 * _LINE)
        place = "" if one.place is None else f" · {one.place}"
        self._text(one.title + place, size=11, bold=True, color=color)
        self._facts(one.facts)

    def _facts(self, facts: FactTable) -> None:
        self._rows(facts.rows, INK)
        self._rows(facts.details, SOFT)
        self._skip(0.3)

    def _rows(self, rows: Sequence[Row], color: str) -> None:
        for label, values in rows:
            for number, value in enumerate(values):
                self._cells(["" if number else label, value], (16, 84), color=color)

    def _grid(self, grid: blocks.Grid) -> None:
        header, rows = grid.table
        if grid.folded:
            self._room(5 * _LINE)
            self._text(grid.folded, size=12, bold=True)
        self._cells(header, grid.widths, color=SOFT, ruled=True)
        for row in rows:
            self._cells(row, grid.widths, ruled=True)
        self._skip()

    def _picture(self, picture: blocks.Picture) -> None:
        self._room(_least_height(picture))
        height = min(_height(picture), self._left - _caption_height(picture))
        picture.draw(_part(self._figure, self._top - height, height), *picture.of)
        self._top -= height + 0.2 * _LINE
        self._text(picture.caption, size=8, color=SOFT)
        self._skip(0.3)

    def _text(
        self, text: str, *, size: float = 9, bold: bool = False, color: str = INK
    ) -> None:
        weight = "bold" if bold else "normal"
        for line in wrapped(text, _WIDTH_IN, size=size, bold=bold) if text else ():
            self._room(_LINE * size / 9)
            self._figure.text(
                _LEFT, self._top, line, size=size, weight=weight, color=color, va="top"
            )
            self._top -= _LINE * size / 9

    def _cells(
        self,
        cells: Sequence[str],
        widths: tuple[int, ...],
        *,
        color: str = INK,
        ruled: bool = False,
    ) -> None:
        scale = (_RIGHT - _LEFT) / sum(widths)
        texts = [
            wrapped(cell, width * scale * A4_IN[0] - _BETWEEN_IN, size=8)
            for cell, width in zip(cells, widths, strict=True)
        ]
        lines = max(map(len, texts))
        self._room(lines * _LINE)
        left = _LEFT
        for text, width in zip(texts, widths, strict=True):
            for number, line in enumerate(text):
                y = self._top - number * _LINE * 0.9
                self._figure.text(left, y, line, size=8, color=color, va="top")
            left += width * scale
        self._top -= lines * _LINE * 0.9
        if ruled:
            self._figure.add_artist(_rule(self._top - 0.2 * _LINE))
            self._skip(0.4)

    @property
    def _left(self) -> float:
        return self._top - _BOTTOM

    def _skip(self, lines: float = 1.0) -> None:
        if self._top < _TOP:
            self._top -= lines * _LINE

    def _room(self, height: float) -> None:
        """Start a new page unless `height`, as a share of the page, is free."""
        if self._left < height and self._top < _TOP:
            self.end_page()
            self._begin_page()

    def _begin_page(self) -> None:
        self._figure, self._top = new_figure(*A4_IN), _TOP

    def end_page(self) -> None:
        """Print the page's number, and save the page to the PDF."""
        self._number += 1
        figure = self._figure
        figure.text(_RIGHT, 0.025, str(self._number), ha="right", color=SOFT, size=8)
        name, *more = wrapped(self._name, _WIDTH_IN - 0.5, size=8)
        figure.text(_LEFT, 0.025, f"{name} …" if more else name, color=SOFT, size=8)
        self._pages.savefig(figure)  # type: ignore[no-untyped-call]


def _height(picture: blocks.Picture) -> float:
    return picture.height_in * _WIDTH_IN / WIDTH_IN / A4_IN[1]


def _caption_height(picture: blocks.Picture) -> float:
    lines = wrapped(picture.caption, _WIDTH_IN, size=8) if picture.caption else []
    return (len(lines) + 1) * _LINE


def _least_height(block: blocks.Block | None) -> float:
    """Free height that a page must have for a block to begin on it, as a share of the page."""
    if isinstance(block, blocks.Picture):
        return _LEAST_SHARE * _height(block) + _caption_height(block)
    return 2 * _LINE


def _rule(height: float) -> "Artist":
    from matplotlib.lines import Line2D

    return Line2D([_LEFT, _RIGHT], [height, height], color=FAINT, lw=0.5)


def _part(figure: "Figure", bottom: float, height: float) -> "FigureBase":
    """Subfigure between the side margins; `bottom` and `height` are shares of the page."""
    grid = figure.add_gridspec(
        3,
        3,
        height_ratios=[1.0 - bottom - height, height, bottom],
        width_ratios=[_LEFT, _RIGHT - _LEFT, 1.0 - _RIGHT],
    )
    return figure.add_subfigure(grid[1, 1])
