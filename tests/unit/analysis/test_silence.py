"""Where a flight would have heard its tags: in the report, and as the page is answered."""

import base64
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joined import joined
from sql import sql

from uavrt.analysis.whole_flights.judged_flights import WholeFlightOptions, searched_for
from uavrt.cli.prediction.coverage import coverage
from uavrt.cli.results.report import report
from uavrt.config.tags.tag_files import write_tags
from uavrt.core.clock import iso_intervals
from uavrt.core.earth.tangent_plane import plane_around
from uavrt.core.errors import FormatError, UsageError
from uavrt.flight.integrated import IntegratedVerdict, write_integrated
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.store.estimates import AntennaChoice
from uavrt.ground.web.work.flight_maps import CoverageMapJobs, CoverageMapRequest
from uavrt.localization.antenna import pattern_named

pytestmark = pytest.mark.slow

WriteFlight = Callable[..., Path]
ANTENNA = AntennaChoice()


def answered(jobs: CoverageMapJobs, asked: CoverageMapRequest) -> dict[str, object]:
    """Ask, and ask again when the map is there or cannot be made."""
    answer = jobs.answer(asked)
    joined("map of silence")
    return jobs.answer(asked) if answer["state"] == "working" else answer


def around(flight: Path, half_m: float) -> list[list[float]]:
    poses = read_flight(flight).poses
    plane = plane_around(
        np.array([one.latitude_deg for one in poses]),
        np.array([one.longitude_deg for one in poses]),
    )
    sides = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half_m
    latitude, longitude = plane.to_geodetic(*sides.T)
    return [list(one) for one in zip(longitude.tolist(), latitude.tolist(), strict=True)]


@pytest.fixture
def flight(write_flight: WriteFlight) -> Path:
    """Two tags, of which one was heard."""
    return write_flight(tags=2, heard=1)


@pytest.fixture
def area(flight: Path, tmp_path: Path) -> Path:
    corners = around(flight, 600.0)
    path = tmp_path / "area.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [[*corners, corners[0]]]}))
    return path


def test_the_report_maps_where_each_tag_would_have_been_heard(
    flight: Path, tmp_path: Path
) -> None:
    report(flight, tag_power=-60.0, output=tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    first, second = (tag.tag_id for tag in read_flight(flight).info.tags)
    assert page.count("would be detected</h2>") == 2
    assert "confirmed pulses)" in page
    assert "not detected: where the map is yellow" in page
    assert "the ground is assumed to be level" in page
    assert f"Where tag {first}" in page
    assert f"Where tag {second}" in page
    assert (tmp_path / "report.pdf").stat().st_size > 10_000


def test_the_page_is_told_how_probably_a_silent_tag_is_not_in_an_area(flight: Path) -> None:
    heard, silent = (tag.tag_id for tag in read_flight(flight).info.tags)
    jobs, found = CoverageMapJobs(), {}
    for tag_id in (silent, heard):
        wanted = {"tag_id": tag_id, "tag_power_dbm": -60}
        asked = CoverageMapRequest.from_request(flight, ANTENNA, wanted)
        with pytest.raises(UsageError, match="not ready yet"):
            jobs.absence(asked, wanted | {"outline": around(flight, 200.0)})
        found[tag_id] = answered(jobs, asked)
        assert found[tag_id]["state"] == "done"
        picture = base64.b64decode(str(found[tag_id]["picture"]))
        assert picture.startswith(b"\x89PNG")
        if tag_id == silent:
            near = jobs.absence(asked, wanted | {"outline": around(flight, 200.0)})
            wide = jobs.absence(asked, wanted | {"outline": around(flight, 1500.0)})
            assert near["prior"] < wide["prior"]
            assert near["not_here"] > wide["not_here"] > 1.0 - wide["prior"]
            with pytest.raises(FormatError, match="an outline"):
                jobs.absence(asked, wanted | {"outline": [[8.0, 47.0]]})
        else:
            with pytest.raises(UsageError, match="was detected"):
                jobs.absence(asked, wanted | {"outline": around(flight, 200.0)})
    assert found[heard]["heard_pulses"]
    assert not found[silent]["heard_pulses"]


def test_what_cannot_be_mapped_is_told(flight: Path, tmp_path: Path) -> None:
    unknown = CoverageMapRequest.from_request(
        flight, ANTENNA, {"tag_id": 77, "tag_power_dbm": -25}
    )
    answer = answered(CoverageMapJobs(), unknown)
    assert answer["state"] == "failed"
    assert "was not listed" in str(answer["error"])
    gone = AntennaChoice(dem=str(tmp_path / "gone.hgt"))
    asked = CoverageMapRequest.from_request(flight, gone, {"tag_id": 2, "tag_power_dbm": -25})
    assert "there is no" in str(answered(CoverageMapJobs(), asked)["error"])
    for wrong in ({}, {"tag_id": 2}, {"tag_id": 2, "tag_power_dbm": 300}):
        with pytest.raises((FormatError, UsageError)):
            CoverageMapRequest.from_request(flight, ANTENNA, wrong)


def hindsight(
    flight: Path,
    tag_id: int,
    *,
    found: bool,
    chance: float = 0.6,
    listened: str = "",
    ambiguous: bool = False,
    searched: dict[str, Any] | None = None,
) -> None:
    """What a whole flight said of a tag."""
    tag = next(one for one in read_flight(flight).info.tags if one.tag_id == tag_id)
    verdict = IntegratedVerdict(
        tag_id=tag_id,
        found=found,
        false_alarm_probability=0.0001 if found else chance,
        interval_s=tag.pulse_intervals_s[0],
        frequency_hz=tag.frequency_hz,
        listened=listened,
        ambiguous=ambiguous,
        searched=None
        if searched is None
        else replace(
            searched_for(tag, WholeFlightOptions(pattern=pattern_named("RA-23K"))), **searched
        ),
    )
    write_integrated(flight, [verdict], [])


def covered(flight: Path, area: Path, capsys: pytest.CaptureFixture[str]) -> dict[int, Any]:
    """By tag, what `uavrt coverage` tells of a weak tag in an area."""
    coverage(flight, tag_power=-62.0, area=area, cell=100.0, as_json=True)
    return {one["tag_id"]: one for one in json.loads(capsys.readouterr().out)}


def test_silence_over_the_whole_flight_tells_more_than_that_of_groups(
    flight: Path, area: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heard, silent = (tag.tag_id for tag in read_flight(flight).info.tags)
    before = covered(flight, area, capsys)[silent]
    assert not before["whole_flight"]
    assert any("uavrt integrate" in text for text in before["limitations"])
    hindsight(flight, silent, found=False)
    after = covered(flight, area, capsys)[silent]
    assert after["whole_flight"]
    assert after["mean_probability"] > before["mean_probability"]
    assert after["not_here"] > before["not_here"] > 1.0 - before["prior"]
    report(flight, tag_power=-62.0, pdf=False, output=tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Would be found over the whole flight" in page
    capsys.readouterr()
    assert covered(flight, area, capsys)[heard]["heard_pulses"] > 0


def test_silence_says_nothing_of_the_time_without_samples(
    flight: Path, area: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    read = read_flight(flight)
    silent, begin = read.info.tags[1].tag_id, read.poses[0].time_ns
    length_ns = read.poses[-1].time_ns - begin
    not_here = []
    for share in (1.0, 0.3, 0.02):
        listened = iso_intervals([(begin, begin + round(share * length_ns))])
        hindsight(flight, silent, found=False, listened=listened)
        told = covered(flight, area, capsys)[silent]
        not_here.append(told["not_here"])
        missing = [text for text in told["limitations"] if "samples exist" in text]
        assert len(missing) == (share < 1.0)
    assert not_here[0] > not_here[1] > not_here[2] == pytest.approx(1.0 - told["prior"])
    # Asked for fewer false alarms than the map reckons with, it is no silence either.
    hindsight(flight, silent, found=False, chance=0.003)
    assert covered(flight, area, capsys)[silent]["not_here"] is None
    hindsight(flight, silent, found=False, listened="noon/one")
    with pytest.raises(FormatError, match="integrate again"):
        covered(flight, area, capsys)


def test_a_tag_found_in_hindsight_is_not_silent(
    flight: Path, area: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    silent = read_flight(flight).info.tags[1].tag_id
    corners = around(flight, 600.0)
    hindsight(flight, silent, found=True)
    told = covered(flight, area, capsys)[silent]
    assert told["in_hindsight"]
    assert told["not_here"] is None
    jobs, wanted = CoverageMapJobs(), {"tag_id": silent, "tag_power_dbm": -62}
    asked = CoverageMapRequest.from_request(flight, ANTENNA, wanted)
    assert answered(jobs, asked)["in_hindsight"]
    with pytest.raises(UsageError, match="was detected"):
        jobs.absence(asked, wanted | {"outline": corners})


def test_a_tag_that_may_be_another_train_is_not_silent(
    flight: Path, area: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    silent = read_flight(flight).info.tags[1].tag_id
    corners = around(flight, 600.0)
    hindsight(flight, silent, found=False, ambiguous=True)
    told = covered(flight, area, capsys)[silent]
    assert told["not_here"] is None
    assert any("may come from this tag" in text for text in told["limitations"])
    jobs, wanted = CoverageMapJobs(), {"tag_id": silent, "tag_power_dbm": -62}
    asked = CoverageMapRequest.from_request(flight, ANTENNA, wanted)
    assert answered(jobs, asked)["state"] == "done"
    with pytest.raises(UsageError, match="its absence cannot be shown"):
        jobs.absence(asked, wanted | {"outline": corners})


@pytest.mark.parametrize(
    ("searched", "why"),
    [
        ({"frequency_window_hz": 2.0}, "frequencies within 2 Hz of the listed one"),
        ({"frequency_hz": 148.6e6}, "a frequency, pulse width"),
        ({"antenna": "of another computer"}, "the map is for RA-23K"),
    ],
)
def test_a_search_of_less_than_the_tag_may_be_is_no_silence(
    flight: Path,
    area: Path,
    capsys: pytest.CaptureFixture[str],
    searched: dict[str, Any],
    why: str,
) -> None:
    silent = read_flight(flight).info.tags[1].tag_id
    by_groups = covered(flight, area, capsys)[silent]
    hindsight(flight, silent, found=False, searched=searched)
    told = covered(flight, area, capsys)[silent]
    assert not told["whole_flight"]
    assert told["mean_probability"] == by_groups["mean_probability"]
    assert why in " ".join(told["limitations"])
    assert "integrate again" in " ".join(told["limitations"])


def test_a_list_that_allows_more_than_was_searched_is_no_silence(
    flight: Path, area: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tag = read_flight(flight).info.tags[1]
    hindsight(flight, tag.tag_id, found=False, searched={})
    wider = replace(tag, interval_uncertainty_s=0.06, interval_jitter_s=0.02)
    write_tags(tmp_path / "tags.toml", [wider])
    coverage(
        flight,
        tag_power=-62.0,
        area=area,
        cell=100.0,
        tags=tmp_path / "tags.toml",
        as_json=True,
    )
    (told,) = json.loads(capsys.readouterr().out)
    assert not told["whole_flight"]
    assert "but the tag's may differ by 60 ms" in " ".join(told["limitations"])
    assert "but they may be 20 ms off" in " ".join(told["limitations"])


def test_silence_is_that_of_the_search_that_was_made(
    flight: Path, area: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    silent = read_flight(flight).info.tags[1].tag_id
    not_here = []
    for searched in ({}, {"frequency_window_hz": 1800.0}, {"most_drift": 0.05}):
        hindsight(flight, silent, found=False, searched=searched)
        told = covered(flight, area, capsys)[silent]
        assert told["whole_flight"]
        assert told["antenna"] == "RA-23K"
        not_here.append(told["not_here"])
    # The more is looked for, the more of it noise shows by chance: weak tags are heard less.
    assert not_here[0] > max(not_here[1:])
    hindsight(flight, silent, found=False, searched={"antenna": "RA-2A"})
    told = covered(flight, area, capsys)[silent]
    assert told["whole_flight"]
    assert told["antenna"] == "RA-2A"
    hindsight(flight, silent, found=False)
    told = covered(flight, area, capsys)[silent]
    assert "did not record" in " ".join(told["limitations"])


def test_where_nothing_tells_that_a_detector_ran_silence_is_not_called_sure(
    write_flight: WriteFlight, area: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Poses alone are no listening: the flight had no samples, no reports and no pulses."""
    listening, deaf = write_flight(tags=2, heard=1), write_flight(tags=2, heard=0)
    sql(deaf, "DELETE FROM search_reports")
    for flight, ran in ((listening, True), (deaf, False)):
        records = covered(flight, area, capsys)
        assert len(records) == 2
        for told in records.values():
            doubted = "no record shows that a detector ran" in " ".join(told["limitations"])
            assert doubted == (not ran)
            assert ran or told["sure_within_m"] is None


def test_an_antenna_that_nobody_told_is_told_as_assumed(
    flight: Path, area: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = covered(flight, area, capsys)
    assert read_flight(flight).settings_json is None
    for one in told.values():
        assert "RA-23K assumed" in " ".join(one["limitations"])
