"""The report: complete in itself, and possible whatever the flight found."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from html.parser import HTMLParser
from pathlib import Path

import made
import numpy as np
import pytest
from command_line import Ran
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox
from report_text import draw_in_report, said_in_report
from some import some
from sql import sql
from tests.unit.analysis.conftest import WriteFlight

from uavrt.analysis.estimates.bearings import (
    NO_BEARINGS_FROM_THESE,
    learnt_antenna,
    read_recorded,
)
from uavrt.analysis.inputs.flight_facts import ReportFacts, facts_of, write_facts
from uavrt.analysis.report import report_words as words
from uavrt.analysis.report.document import pdf_document, write_pages
from uavrt.analysis.report.report_maps import draw_overview, draw_tag_map
from uavrt.analysis.report.report_page import html_page
from uavrt.analysis.report.report_times import draw_times
from uavrt.analysis.report.roses import draw_roses
from uavrt.analysis.report.searches import searches_of, summary
from uavrt.analysis.report.style import new_figure, styled
from uavrt.analysis.survey import Survey, read_survey
from uavrt.core.errors import ConfigError
from uavrt.core.messages import Beep, BeepKind, SearchNote, SoughtTag
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.flight_reader import read_search_notes
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.estimates.flight_estimates import EstimationOptions
from uavrt.simulation.scene.scenario import Scenario

pytestmark = pytest.mark.slow


class Page(HTMLParser):
    """What a browser would fetch, and what a reader would read."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []
        self.words: list[str] = []
        self.pictures: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "img"):
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href", "action", "srcset") and value:
                inside = value.startswith("data:image/svg+xml;base64,")
                (self.pictures if inside else self.fetched).append(value)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(self.words).replace("\u00a0", " ")


@pytest.fixture(scope="module")
def survey(write_flight: WriteFlight) -> Survey:
    return read_survey(write_flight())


@pytest.fixture(scope="module")
def silent(write_flight: WriteFlight) -> Survey:
    """A flight without pulses and poses."""
    return read_survey(write_flight(heard=0, poses=False))


def test_the_page_fetches_nothing_and_says_where_the_tag_is(survey: Survey) -> None:
    html = html_page(survey)
    page = Page(html)
    assert page.open == []
    assert page.fetched == []
    assert len(page.pictures) == 5  # overview, map, roses, times, noise
    found = some(some(survey.position_of(2)).position)
    assert f"{found.latitude_deg:.5f}, {found.longitude_deg:.5f}" in page.text
    assert "Kiwi & <Chick>" in page.text
    assert "Detected no, in 239 s of search" in page.text
    assert "samples lost <12>" in page.text
    assert "Lenth" in page.text
    # Figures that help no decision are folded.
    folded = html[html.index("<details>") : html.index("</details>")]
    assert "<dt>Strongest trace</dt><dd>40\u00a0% of the threshold</dd>" in folded
    assert html.count("Strongest trace") == 1


def test_the_headline_says_what_its_bearings_say(survey: Survey) -> None:
    doubtful = replace(survey.bearings[0].bearing, multipath_suspected=True)
    first = replace(survey.bearings[0], bearing=doubtful)
    doubted = replace(survey, bearings=(first, *survey.bearings[1:]))
    (plain, _), (told, _) = words.findings(survey), words.findings(doubted)
    assert "reflection" not in str(plain.facts)
    rows = dict(told.facts.rows)
    assert rows["Caution"][0].startswith(
        "in 1 of its 3 bearings the signal was probably reflected"
    )
    assert rows["Based on"] == ["3 bearings"]
    assert rows["Time"][0].endswith("UTC")


def test_the_headline_says_what_may_be_wrong_with_all_bearings(survey: Survey) -> None:
    rows = dict(words.findings(survey)[0].facts.rows)
    assert any("an error shared by all bearings" in text for text in rows["Caution"])


def test_a_card_has_the_words_of_the_command_line(
    survey: Survey, write_flight: WriteFlight, ran: Ran
) -> None:
    (line, *_) = ran("localize", write_flight()).out.splitlines()
    finding = words.findings(survey)[0]
    rows = dict(finding.facts.rows)
    assert f"{finding.place}, within {rows['Within'][0]}, from {rows['Based on'][0]}" in line


def test_the_pdf_has_a_page_for_each_heard_tag(survey: Survey) -> None:
    content = pdf_document(survey)
    assert content.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type /Page\b", content)) == 3  # first, tag 2, bearings to methods


def test_a_flight_without_pulses_and_poses_still_has_a_report(silent: Survey) -> None:
    page = Page(html_page(silent))
    assert "Detected no" in page.text
    assert "0 of 2 tags received, 0 pulses" in page.text
    assert pdf_document(silent).startswith(b"%PDF-")


def test_pulses_without_poses_are_reported_with_the_reason(write_flight: WriteFlight) -> None:
    survey = read_survey(write_flight(poses=False))
    (first, second) = words.findings(survey)
    assert first.place is None
    assert dict(first.facts.rows)["No position"] == [
        "it was not detected at any known position"
    ]
    assert dict(second.facts.rows)["Detected"] == ["no, in 239 s of search"]
    assert any("have no pose" in warning for warning in survey.warnings)
    assert any("No bearings" in warning for warning in survey.warnings)


class Pages:
    """Takes a report's pages in place of a PDF file."""

    def __init__(self) -> None:
        self.figures: list[Figure] = []

    def savefig(self, figure: Figure) -> None:
        figure.canvas.draw()
        self.figures.append(figure)


def named(survey: Survey, name: str) -> Survey:
    """The same flight past tags of a longer name."""
    assert survey.info is not None
    tags = tuple(replace(tag, name=name) for tag in survey.info.tags)
    return replace(survey, name=f"flight {name}", info=replace(survey.info, tags=tags))


def extent(artist: Artist) -> Bbox:
    figure = some(artist.get_figure(root=True))
    return artist.get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "name", ["W" * 60, "a hyena of the northern clan, with a torn left ear, tagged"]
)
def test_long_names_stay_on_the_page_and_off_the_maps(survey: Survey, name: str) -> None:
    pages = Pages()
    with styled():
        write_pages(pages, named(survey, name))  # type: ignore[arg-type]
        assert len(pages.figures) >= 3
        for figure in pages.figures:
            texts = [one for one in figure.texts if one.get_text()]
            assert texts
            for one in texts:
                box = extent(one)
                assert box.x0 >= 0.0, one.get_text()
                assert box.x1 <= figure.bbox.x1, one.get_text()
        titled = [
            [one for one in figure.texts if one.get_fontsize() == 14]
            for figure in pages.figures
        ]
        titles = next(filter(None, titled))
        tag_page = pages.figures[titled.index(titles)]
        assert "".join(one.get_text() for one in titles).replace(" ", "") == (
            f"Tag2{name}".replace(" ", "")
        )
        lowest = min(extent(one).y0 for one in titles)
        drawn = [part.get_tightbbox() for part in tag_page.subfigs]
        assert lowest > max(box.y1 for box in drawn if box is not None)


@pytest.mark.parametrize("name", ["W" * 60, "Kiwi"])
def test_the_legend_leaves_the_north_arrow_to_be_seen(survey: Survey, name: str) -> None:
    with styled():
        for draw in (draw_overview, partial(draw_tag_map, tag_id=2)):
            figure = new_figure(6.9, 4.4)
            draw(figure, named(survey, name))
            figure.canvas.draw()
            axes = figure.axes[0]
            (arrow,) = (one for one in axes.texts if isinstance(one, Annotation))
            legend = some(axes.get_legend())
            assert not extent(arrow).overlaps(extent(legend))


def test_roses_show_the_antenna_as_the_turns_have_shown_it(write_flight: WriteFlight) -> None:
    flight = write_flight(heard=2)
    survey = read_survey(flight, EstimationOptions(antenna="H", offset_deg=30.0))
    learnt = learnt_antenna(read_recorded(flight), "H", 30.0)
    (one, *_) = survey.bearings_of(2)
    assert one.bearing.level_db is not None
    with styled():
        figure = new_figure(7.6, 3.7)
        draw_roses(figure, survey, 2)
        rose, rest = figure.axes[:2]
        around = np.degrees(np.asarray(rose.lines[0].get_xdata(), float))
        drawn = np.asarray(rose.lines[0].get_ydata(), float)
        residuals = np.asarray(rest.lines[-1].get_ydata(), float)
    off = around - one.bearing.bearing_deg
    expected = one.bearing.level_db + learnt.gain_db(off)
    table = one.bearing.level_db + PATTERNS["H"].gain_db(off)
    shown = drawn > drawn.min() + 0.01  # below, the rose ends
    assert drawn[shown] == pytest.approx(expected[shown], abs=1e-6)
    assert np.abs(drawn - table)[shown].max() > 1.0
    assert np.sqrt(np.mean(residuals**2)) < 3.0


def test_ten_tags_have_ten_findings_in_order(write_flight: WriteFlight) -> None:
    survey = read_survey(write_flight(tags=10, heard=3))
    assert [one.tag_id for one in words.findings(survey)] == list(range(2, 12))
    assert sum(one.place is not None for one in words.findings(survey)) == 3
    header, rows = words.tag_table(survey)
    assert len(rows) == 10
    assert all(len(row) == len(header) for row in rows)
    with styled():
        figure = new_figure(7.6, 6.4)
        draw_overview(figure, survey)
        assert len(figure.axes[0].get_legend_handles_labels()[1]) == 4


def test_an_old_log_of_the_original_gets_a_report_without_bearings(tmp_path: Path) -> None:
    line = (
        "2, 148.71, 170020541{}, 230494976, 170020541{}, 250494957, 1700205420, 434494972, "
        "1700205420, 4294967295, 69.6484, 0.219541, 1, 69.8253, 1, 1, 47.3978, 8.54561, "
        "488.077, 0.00189066, -0.00109068, 0.71339, 0.700764\n"
    )
    path = tmp_path / "pulse_pose_log.txt"
    path.write_text("".join(line.format(n, n) for n in range(9)))
    survey = read_survey(path)
    assert survey.bearings == ()
    assert survey.warnings[-1] == NO_BEARINGS_FROM_THESE
    assert "half-way" in said_in_report(survey)


def test_the_report_tells_what_people_tell_of_the_flight(write_flight: WriteFlight) -> None:
    flight = write_flight(heard=0, poses=False, name="told")
    assert read_survey(flight).facts == ReportFacts()
    (flight.parent / "report.toml").write_text(
        'operator = "A. <Ranger>"\npermit = "FWC-118"\nspecies = "Lynx lynx"\n'
        'aircraft = "X500"\ntime_zone = "Europe/Zurich"\naltitude_datum = "LN02"\n',
        encoding="utf-8",
    )
    survey = read_survey(flight)
    said = said_in_report(survey)
    for text in ("Operator: A. <Ranger>", "Permit: FWC-118", "Species: Lynx lynx", "LN02"):
        assert text in said
    assert f"({survey.facts.local_time(some(survey.span_ns)[0])})" in said


def test_local_time_stands_beside_utc_wherever_a_time_is_told(survey: Survey) -> None:
    local = replace(survey, facts=ReportFacts(time_zone="Asia/Tokyo"))
    (finding, _) = words.findings(local)
    (time,) = dict(finding.facts.rows)["Time"]
    told = some(re.fullmatch(r"(\d\d):(\d\d:\d\d) UTC \((\d\d):(\d\d:\d\d) JST\)", time))
    assert (int(told[1]) + 9) % 24 == int(told[3])
    assert told[2] == told[4]
    bearings, tags = words.bearing_table(local), words.tag_table(local)
    assert "Time UTC (JST)" in bearings[0]
    assert "Last detected UTC (JST)" in tags[0]
    both = re.compile(r"\d\d:\d\d:\d\d \(\d\d:\d\d:\d\d\)")
    assert all(both.fullmatch(row[1]) for row in bearings[1])
    assert both.fullmatch(tags[1][0][6])
    assert all(both.fullmatch(time) for time, _ in words.events(local))
    with styled():
        figure = new_figure(7.0, 4.0)
        draw_times(figure, local, 2)
    assert re.fullmatch(
        r"minutes after [\d:]+ UTC \([\d:]+ JST\)", figure.axes[-1].get_xlabel()
    )
    assert "Time UTC" in words.bearing_table(survey)[0]
    assert "(" not in words.bearing_table(survey)[1][0][1]


def test_facts_are_written_as_they_are_read(tmp_path: Path) -> None:
    facts = ReportFacts(
        operator='A. "Ranger" \\ Söhne', permit="飛行-118", time_zone="Asia/Tokyo"
    )
    write_facts(tmp_path, facts)
    assert facts_of(tmp_path / "flight_log_x") == facts
    with pytest.raises(ConfigError, match="no time zone"):
        write_facts(tmp_path, ReportFacts(time_zone="Moon/Base"))
    with pytest.raises(ConfigError, match="operator is not text"):
        write_facts(tmp_path, ReportFacts(operator="two\nlines"))
    assert facts_of(tmp_path / "flight_log_x") == facts
    write_facts(tmp_path, ReportFacts())
    assert facts_of(tmp_path / "flight_log_x") == ReportFacts()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("pilot = 'x'", "Choose from operator"),
        ("operator = 3", "not text"),
        ("=", "Correct the file"),
        ('time_zone = "Moon/Base"', "no time zone"),
    ],
)
def test_a_wrong_report_toml_is_told(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "report.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=says):
        facts_of(tmp_path / "flight")


def searched(survey: Survey, scenario: Scenario, *, ended: bool = True) -> Survey:
    """A flight with a search that found one of two tags."""
    home = scenario.home.latitude_deg, scenario.home.longitude_deg
    found = SoughtTag(
        tag_id=2,
        latitude_deg=home[0] + 0.001,
        longitude_deg=home[1] + 0.004,
        radius95_m=22.0,
        existence=0.999,
        found_s=150.0,
        pulses=71,
        missed=5,
    )
    unknown = replace(
        found,
        tag_id=3,
        found_s=None,
        existence=0.31,
        pulses=0,
        missed=160,
        likely=((home[0] - 0.002, home[1], 0.4), (home[0] - 0.002, home[1] + 0.001, 0.2)),
    )
    begun = SearchNote(
        time_ns=scenario.start_time_ns + 10**9,
        order_id=5,
        event="begun",
        text="search 2 tags in 9.0 ha at 40 m to 25 m, 15 min, then return",
        reason="mi_rate",
        elapsed_s=0.0,
        latitude_deg=home[0],
        longitude_deg=home[1],
        height_m=40.0,
        battery_percent=90.0,
        tags=(replace(found, found_s=None), replace(unknown, likely=())),
        area=tuple(
            (home[0] + a, home[1] + b) for a, b in ((0.0, 0.0), (0.002, 0.0), (0.0, 0.003))
        ),
    )
    decided = replace(
        begun, event="decision", text="fly 40 m N", reason="0.1 nats/s of <35>", area=()
    )
    end = replace(
        decided,
        event="ended",
        time_ns=scenario.start_time_ns + 200 * 10**9,
        elapsed_s=199.0,
        text="1 of 2 found",
        reason="a pilot took over",
        tags=(found, unknown),
    )
    notes = (begun, decided, end) if ended else (begun, decided)
    return replace(survey, search_notes=notes)


def test_a_search_is_told_with_its_reasons_minutes_and_what_is_unknown(
    survey: Survey, silent: Survey, scenario_of: Callable[[int], Scenario]
) -> None:
    survey = searched(survey, scenario_of(2))
    text = said_in_report(survey)
    assert "UTC: a pilot took over" in text
    assert "Found 1 of 2 in 3.3 minutes, 3.3 minutes for each animal" in text
    assert "after 2.5 min" in text
    assert "Tag 3 not found: detected 0 times, 160 times not" in text
    assert "with 31 %" in text
    assert "(40 %)" in text
    assert "0.1 nats/s of <35>" in text
    assert text.count("Autonomous search") == 1
    assert draw_in_report(survey, "Map of the search").axes
    assert pdf_document(searched(silent, scenario_of(2))).startswith(b"%PDF")


def test_a_search_whose_recording_broke_off_is_told_as_far_as_it_went(
    survey: Survey, scenario_of: Callable[[int], Scenario]
) -> None:
    survey = searched(survey, scenario_of(2), ended=False)
    (search,) = searches_of(survey)
    rows = dict(summary(survey, search).rows)
    assert rows["Ended"][0].endswith(": the recording ends early")
    assert rows["Found"][0].startswith("0 of 2 in")


def test_flights_from_before_there_were_searches_have_none(write_flight: WriteFlight) -> None:
    flight = write_flight(tags=1, name="flight_log_old")
    sql(flight, "DROP TABLE search_notes")
    assert read_search_notes(flight) == ()
    assert not list(searches_of(read_survey(flight)))


TAGS = made.tag(2, 148_710_000.0), made.tag(4, 148_760_000.0)


def beeping(directory: Path, *beeps: Beep) -> Survey:
    recorder = FlightRecorder.create(made.flight_info(directory, TAGS))
    recorder.write(*beeps)
    recorder.close()
    return read_survey(directory)


def test_a_report_has_a_line_for_each_odd_sender_and_none_for_listed_ones(
    tmp_path: Path,
) -> None:
    survey = beeping(
        tmp_path / "flight",
        made.beep(frequency_hz=148_710_640.0, tag_ids=(2,), offsets_hz=(640.0,)),
        made.beep(BeepKind.UNLISTED, frequency_hz=148_935_200.0, interval_s=1.102),
        made.beep(BeepKind.LISTED, tag_ids=(2,), offsets_hz=(3.0,)),
    )
    assert [row[1:] for row in some(words.beep_table(survey))[1]] == [
        ["148.710640", "1254", "12", "20", "tag 2, 640 Hz above its label"],
        ["148.935200", "1102", "12", "20", "unlisted"],
    ]
    assert "Other beeping signals" in said_in_report(survey)


def test_a_report_names_an_offset_of_all_tags_although_each_is_found_as_listed(
    tmp_path: Path,
) -> None:
    found = (
        made.beep(
            BeepKind.LISTED,
            frequency_hz=tag.frequency_hz + 300.0,
            tag_ids=(tag.tag_id,),
            offsets_hz=(300.0,),
        )
        for tag in TAGS
    )
    (row,) = some(words.beep_table(beeping(tmp_path / "flight", *found)))[1]
    assert row[-1].startswith("the tags are +2.0 ppm off their labels: the receiver's")
