"""Lay out the report as one self-contained HTML file."""

import re
from collections.abc import Sequence
from html import escape
from itertools import chain

from uavrt.analysis.estimates.position_words import FactTable, Row
from uavrt.analysis.report import report_blocks as blocks
from uavrt.analysis.report.report_words import Finding
from uavrt.analysis.report.style import WIDTH_IN, new_figure, styled, svg_data
from uavrt.analysis.survey import Survey

_CSS = """
:root { --ink:#1b2430; --soft:#5c6773; --line:#dfe4e9; --warm:#fff6e5; }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); margin: 0 auto; padding: 2rem
  1.25rem 4rem; max-width: 58rem; background: #fff; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; overflow-wrap: anywhere; }
h2 { font-size: 1.25rem; margin: 2.6rem 0 .6rem; }
.sub, figcaption, .small { color: var(--soft); }
.small, figcaption { font-size: .85rem; }
.warn { background: var(--warm); border-left: 4px solid #e69f00; padding: .6rem 1rem;
  margin: 1rem 0; }
.found { display: grid; gap: 1rem; margin: 1.4rem 0;
  grid-template-columns: repeat(auto-fit, minmax(min(22rem, 100%), 1fr)); }
.card { border: 1px solid var(--line); border-top: 5px solid var(--tag); border-radius: 6px;
  padding: .8rem 1rem; }
.card .place { font-size: 1.25rem; font-weight: 600; font-variant-numeric: tabular-nums;
  margin: .1rem 0; user-select: all; }
dl { display: grid; grid-template-columns: minmax(6.5rem, max-content) 1fr; gap: .2rem .8rem;
  margin: .4rem 0 0; font-size: .9rem; font-variant-numeric: tabular-nums; }
dt { color: var(--soft); } dd { margin: 0; overflow-wrap: anywhere; }
dd + dd { grid-column: 2; } summary { color: var(--soft); font-size: .9rem; cursor: pointer;
  margin-top: .4rem; }
figure { margin: 1rem 0; } figure img { width: 100%; height: auto; display: block; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .88rem;
  font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .35rem .7rem .35rem 0; border-bottom: 1px solid var(--line);
  vertical-align: top; }
th { font-weight: 600; color: var(--soft); }
@media print { body { max-width: none; padding: 0; } h2 { break-after: avoid; }
  figure, .card, tr { break-inside: avoid; } }
"""
_UNITS = re.compile(r"(?<=\d) (?=(?:m|km|km²|s|ms|dB|dBm|Hz|MHz|%)\b|%)")
_CLASSES = {"plain": "", "soft": "sub", "small": "small", "warning": "warn"}


def html_page(survey: Survey) -> str:
    """Return the report as HTML. Raises `UsageError` without matplotlib."""
    with styled():
        body = "\n".join(map(_html, blocks.all_blocks(survey)))
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(survey.name)}</title><style>{_CSS}</style></head><body>\n"
        f"{body}\n</body></html>\n"
    )


def _html(block: blocks.Block) -> str:
    match block:
        case blocks.Paragraph(kind="section" | "heading"):
            return f"<h2>{escape(block.text)}</h2>"
        case blocks.Paragraph(kind="title"):
            return f"<h1>{escape(block.text)}</h1>"
        case blocks.Paragraph():
            return f'<p class="{_CLASSES[block.kind]}">{_text(block.text)}</p>'
        case FactTable():
            return _facts(block)
        case blocks.Grid():
            return _grid(block)
        case blocks.Picture():
            return _picture(block)
        case blocks.Cards():
            cards = "".join(_card(one, color) for one, color in block.cards)
            return f'<div class="found">{cards}</div>'


def _card(one: Finding, color: str) -> str:
    place = f'<p class="place">{escape(one.place)}</p>' if one.place else ""
    return (
        f'<div class="card" style="--tag:{color}"><strong>{escape(one.title)}</strong>'
        f"{place}{_facts(one.facts)}</div>"
    )


def _facts(facts: FactTable) -> str:
    return _rows(facts.rows) + _folded("Details", _rows(facts.details))


def _rows(rows: Sequence[Row]) -> str:
    cells = chain.from_iterable(
        (f"<dt>{_text(label)}</dt>", *(f"<dd>{_text(value)}</dd>" for value in values))
        for label, values in rows
        if values
    )
    text = "".join(cells)
    return f"<dl>{text}</dl>" if text else ""


def _folded(title: str, content: str) -> str:
    summary = f"<summary>{escape(title)}</summary>"
    return f"<details>{summary}{content}</details>" if content else ""


def _grid(grid: blocks.Grid) -> str:
    header, rows = grid.table
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{_text(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    table = f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'
    return _folded(grid.folded, table) if grid.folded else table


def _picture(picture: blocks.Picture) -> str:
    figure = new_figure(WIDTH_IN, picture.height_in)
    picture.draw(figure, *picture.of)
    caption = f"<figcaption>{escape(picture.caption)}</figcaption>" if picture.caption else ""
    image = f'<img src="{svg_data(figure)}" alt="{escape(picture.name)}">'
    return f"<figure>{image}{caption}</figure>"


def _text(text: str) -> str:
    """Escape a text for HTML, and keep each number on one line with its unit."""
    return _UNITS.sub("\N{NO-BREAK SPACE}", escape(text))
