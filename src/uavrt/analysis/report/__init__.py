"""The flight report for biologists: one HTML file, one PDF."""

from pathlib import Path
from typing import TYPE_CHECKING

from uavrt.analysis.report.document import pdf_document
from uavrt.analysis.report.page import html_page
from uavrt.analysis.survey import Survey
from uavrt.lazy import lazily
from uavrt.recording.formats.whole_file import write_whole

if TYPE_CHECKING:
    from uavrt.analysis.report.folds import draw_fold
    from uavrt.analysis.report.silences import coverage_png
    from uavrt.analysis.report.style import FAINT, INK, TAG_COLORS, new_figure, styled, svg_data


__all__ = [
    "FAINT",
    "INK",
    "TAG_COLORS",
    "coverage_png",
    "draw_fold",
    "html_page",
    "new_figure",
    "pdf_document",
    "styled",
    "svg_data",
    "write_report",
]


def write_report(survey: Survey, html: Path | None, pdf: Path | None) -> list[Path]:
    """Write the report.

    Parameters
    ----------
    survey : Survey
        What it is about.
    html, pdf : Path, optional
        Where to; None leaves that form out.

    Raises
    ------
    UsageError
        The extra ``uavrt[analysis]`` is not installed.
    RecordingError
        A file cannot be written.
    """
    written = []
    if html is not None:
        write_whole(html, html_page(survey))
        written.append(html)
    if pdf is not None:
        write_whole(pdf, pdf_document(survey))
        written.append(pdf)
    return written


__getattr__ = lazily(
    __name__,
    {
        "FAINT": "style",
        "INK": "style",
        "TAG_COLORS": "style",
        "coverage_png": "silences",
        "draw_fold": "folds",
        "new_figure": "style",
        "styled": "style",
        "svg_data": "style",
    },
)
