"""What a report says and shows, block by block: drawing all its pictures takes seconds."""

import html
import re

from matplotlib.figure import Figure

from uavrt.analysis.report import report_page
from uavrt.analysis.report.report_blocks import Picture, all_blocks
from uavrt.analysis.report.style import WIDTH_IN, new_figure, styled
from uavrt.analysis.survey import Survey


def said_in_report(survey: Survey) -> str:
    """Get all that a reader of the page reads, apart from the pictures."""
    blocks = (one for one in all_blocks(survey) if not isinstance(one, Picture))
    with styled():
        page = " ".join(map(report_page._html, blocks))
    text = re.sub(r"<[^>]+>", " ", page)
    return " ".join(html.unescape(text).split())


def pictures_in_report(survey: Survey) -> list[Picture]:
    """Get the pictures in their order."""
    return [one for one in all_blocks(survey) if isinstance(one, Picture)]


def draw_in_report(survey: Survey, name: str) -> Figure:
    """Draw the first picture whose name begins so, as the page shows it."""
    picture = next(one for one in pictures_in_report(survey) if one.name.startswith(name))
    with styled():
        figure = new_figure(WIDTH_IN, picture.height_in)
        picture.draw(figure, *picture.of)
        figure.canvas.draw()
    return figure
