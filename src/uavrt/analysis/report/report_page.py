"""Make the report as one self-contained HTML file."""

from html import escape

from uavrt.analysis.covered.silence import SilentMap
from uavrt.analysis.report import fold_page as folds
from uavrt.analysis.report import report_heights as heights
from uavrt.analysis.report import report_maps as maps
from uavrt.analysis.report import report_times as times
from uavrt.analysis.report import report_words as words
from uavrt.analysis.report import roses, searches, silences
from uavrt.analysis.report.report_ground import maps_under
from uavrt.analysis.report.style import new_figure, styled, svg_data, tag_color
from uavrt.analysis.survey import Survey
from uavrt.flight.integrated import FlightFold

_CSS = """
:root { --ink:#1b2430; --soft:#5c6773; --line:#dfe4e9; --warm:#fff6e5; }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); margin: 0 auto; padding: 2rem
  1.25rem 4rem; max-width: 58rem; background: #fff; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; overflow-wrap: anywhere; }
h2 { font-size: 1.25rem; margin: 2.6rem 0 .6rem; }
h3 { font-size: 1rem; margin: 1.4rem 0 .3rem; }
.sub, figcaption, .small { color: var(--soft); }
.small, figcaption { font-size: .85rem; }
.warn { background: var(--warm); border-left: 4px solid #e69f00; padding: .6rem 1rem;
  margin: 1rem 0; }
.found { display: grid; grid-template-columns: repeat(auto-fit, minmax(16.5rem, 1fr));
  gap: 1rem; margin: 1.4rem 0; }
.card { border: 1px solid var(--line); border-top: 5px solid var(--tag); border-radius: 6px;
  padding: .8rem 1rem; }
.card .place { font-size: 1.25rem; font-weight: 600; font-variant-numeric: tabular-nums;
  margin: .1rem 0; user-select: all; }
.card p { margin: .2rem 0 0; font-size: .9rem; }
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


def html_page(survey: Survey) -> str:
    """Make the report's HTML; raises `UsageError` without matplotlib."""
    with styled():
        body = [
            f"<h1>{escape(survey.name)}</h1>",
            f'<p class="sub">{escape(words.heading_line(survey))}</p>',
            *(f'<p class="sub">{escape(text)}</p>' for text in survey.facts.lines),
            *(f'<p class="warn">{escape(text)}</p>' for text in survey.warnings),
            _findings(survey),
            "<h2>Map</h2>",
            _figure_of_overview(survey),
            "<h2>Tags</h2>",
            _table(words.tag_table(survey)),
            *(_table(table) for table in [words.code_table(survey)] if table is not None),
            *(_search_section(survey, one) for one in searches.searches_of(survey)),
            *(_tag_section(survey, tag_id) for tag_id in survey.tag_ids),
            *(_fold_section(survey, one) for one in survey.folds),
            *(_silence_section(survey, one) for one in survey.silences),
            _system(survey),
            _methods(survey),
        ]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(survey.name)}</title><style>{_CSS}</style></head><body>\n"
        + "\n".join(body)
        + "\n</body></html>\n"
    )


def _findings(survey: Survey) -> str:
    cards = []
    for one in words.findings(survey):
        color = tag_color(survey.tag_ids, one.tag_id)
        place = f'<p class="place">{escape(one.place)}</p>' if one.place else ""
        cards.append(
            f'<div class="card" style="--tag:{color}"><strong>{escape(one.title)}</strong>'
            f"{place}<p>{escape(one.detail)}</p></div>"
        )
    return f'<div class="found">{"".join(cards)}</div>'


def _figure_of_overview(survey: Survey) -> str:
    figure = new_figure(7.6, 6.4 if survey.track else 1.2)
    maps.draw_overview(figure, survey)
    caption = (
        "Latitude and longitude on WGS84; north is up. Stars: most probable places, with the "
        "line that holds the tag with 95 %. Lines: bearings; shaded: their 90 % arcs; dashed: "
        "bearings not to be trusted. Grey: the flight, from the dot on."
    )
    return _picture(svg_data(figure), "Map of the flight with bearings and positions", caption)


def _search_section(survey: Survey, search: searches.FlownSearch) -> str:
    figure = new_figure(7.6, 6.0)
    searches.draw_search(figure, survey, search)
    parts = ["<h2>Search by the drone itself</h2>"]
    parts += [f"<p>{escape(text)}</p>" for text in searches.sentences(survey, search)]
    parts += [
        _table(searches.found_table(survey, search)),
        _picture(svg_data(figure), "Map of the search", searches.CAPTION),
        f"<details><summary>{len(search.decisions)} decisions and their reasons</summary>",
        _table(searches.decision_table(survey, search)),
        "</details>",
    ]
    return "\n".join(parts)


def _tag_section(survey: Survey, tag_id: int) -> str:
    if not survey.pulses_of(tag_id):
        return ""
    name = f"Tag {words.title_of(survey, tag_id)}"
    parts = [f"<h2>{escape(name)}</h2>"]
    placed = any(one.pose is not None for one in survey.pulses_of(tag_id))
    if placed:
        figure = new_figure(7.6, 5.6)
        maps.draw_tag_map(figure, survey, tag_id)
        signal = survey.signal_of(tag_id)
        caption = words.MAP_CAPTION if signal is None else words.SIGNAL_CAPTION
        parts.append(_picture(svg_data(figure), f"Map of {name}", caption))
        if signal is not None:
            figure = new_figure(7.6, 2.8)
            heights.draw_heights(figure, signal)
            alternative = f"SNR of {name} over height"
            parts.append(_picture(svg_data(figure), alternative, words.HEIGHT_CAPTION))
            for first in range(0, len(signal.layers), heights.PER_PAGE):
                rows = -(-min(heights.PER_PAGE, len(signal.layers) - first) // heights.COLUMNS)
                figure = new_figure(7.6, 3.4 * rows)
                heights.draw_layers(figure, survey, signal, first)
                alternative = f"Maps of {name} by height"
                parts.append(_picture(svg_data(figure), alternative, words.LAYER_CAPTION))
    bearings = survey.bearings_of(tag_id)
    for first in range(0, len(bearings), roses.COLUMNS):
        figure = new_figure(7.6, 3.7)
        roses.draw_roses(figure, survey, tag_id, first)
        caption = (
            "SNR [dB] over heading for each turn in place; grey: the antenna's pattern at the "
            "bearing found; below: what the pattern leaves unexplained."
        )
        parts.append(_picture(svg_data(figure), f"Roses of {name}", caption))
    figure = new_figure(7.6, 3.2)
    times.draw_times(figure, survey, [tag_id])
    parts.append(_picture(svg_data(figure), f"SNR of {name} and heading over time", ""))
    return "\n".join(parts)


def _fold_section(survey: Survey, one: FlightFold) -> str:
    title = f"Tag {words.title_of(survey, one.tag_id)} over the whole flight"
    figure = new_figure(7.6, 4.6)
    folds.draw_fold(figure, one, tag_color(survey.tag_ids, one.tag_id))
    return "\n".join(
        [
            f"<h2>{escape(title)}</h2>",
            *(f"<p>{escape(text)}</p>" for text in words.hindsight(survey, one.tag_id)),
            _picture(svg_data(figure), f"{title}: folded", folds.CAPTION),
        ]
    )


def _silence_section(survey: Survey, one: SilentMap) -> str:
    name = f"tag {words.title_of(survey, one.tag_id)}"
    figure = new_figure(7.6, 6.4)
    silences.draw_silence(figure, survey, one)
    return "\n".join(
        [
            f"<h2>{escape(f'Where {name} would be detected')}</h2>",
            *(f"<p>{escape(text)}</p>" for text in silences.sentences(survey, one)),
            _picture(svg_data(figure), f"Where {name} would be detected", silences.CAPTION),
        ]
    )


def _system(survey: Survey) -> str:
    parts = []
    if survey.bearings:
        parts += ["<h2>Bearings</h2>", _table(words.bearing_table(survey))]
    if (beeps := words.beep_table(survey)) is not None:
        parts += ["<h2>What else beeped</h2>", _table(beeps)]
    if survey.health or survey.search_reports or words.events(survey):
        parts.append("<h2>System</h2>")
    if survey.health:
        parts.append(_table(words.health_table(survey)))
    if survey.search_reports:
        figure = new_figure(7.6, 2.3)
        times.draw_noise(figure, survey)
        caption = "Noise density at each tag's frequency, over the square of full scale."
        parts.append(_picture(svg_data(figure), "Noise over time", caption))
    if events := words.events(survey):
        rows = [[time, text] for time, text in events]
        parts.append(_table(([f"Time {words.zones(survey)}", "Event"], rows)))
    return "\n".join(parts)


def _methods(survey: Survey) -> str:
    paragraphs = "".join(f"<p>{escape(text)}</p>" for text in words.methods(survey))
    sources = "".join(f"<p>{escape(text)}</p>" for text in words.SOURCES)
    credits_ = "".join(
        f'<p class="small">Map: {escape(one.credit)}</p>' for one in maps_under(survey)
    )
    made = f'{credits_}<p class="small">{escape(words.made_by())}</p>'
    return f'<h2>Methods</h2>{paragraphs}<div class="small">{sources}</div>{made}'


def _picture(uri: str, alternative: str, caption: str) -> str:
    text = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return f'<figure><img src="{uri}" alt="{escape(alternative)}">{text}</figure>'


def _table(table: words.Table) -> str:
    header, rows = table
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'
