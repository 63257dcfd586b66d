"""Write a flight's report to files."""

from pathlib import Path

from uavrt.analysis.report.document import pdf_document
from uavrt.analysis.report.page import html_page
from uavrt.analysis.survey import Survey
from uavrt.recording.formats.whole_file import write_whole


def write_report(survey: Survey, html: Path | None, pdf: Path | None) -> list[Path]:
    """Write the report.

    `html`, `pdf`: where to; None leaves that form out.
    Raises `UsageError`: the extra ``uavrt[analysis]`` is not installed.
    Raises `RecordingError`: a file cannot be written.
    """
    written = []
    if html is not None:
        write_whole(html, html_page(survey))
        written.append(html)
    if pdf is not None:
        write_whole(pdf, pdf_document(survey))
        written.append(pdf)
    return written
