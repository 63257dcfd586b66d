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
from tests.unit.analysis.conftest import WriteFlight

from uavrt.analysis.whole_flights.judged_flights import WholeFlightOptions, searched_for
from uavrt.cli.prediction.coverage import coverage
from uavrt.cli.results.report import report
from uavrt.config.tags.tag_files import write_tags
from uavrt.core.clock import iso_intervals
from uavrt.core.earth.tangent_plane import plane_around
from uavrt.core.errors import FormatError, UsageError
from uavrt.core.messages import Tag
from uavrt.flight.integrated import IntegratedVerdict, write_integrated
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.store.estimates import AntennaChoice
from uavrt.ground.web.work.flight_maps import CoverageMapJobs, CoverageMapRequest
from uavrt.localization.antenna import pattern_named

pytestmark = pytest.mark.slow

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
def silent(flight: Path) -> Tag:
    """The tag that was not heard."""
    return read_flight(flight).info.tags[1]


Covered = Callable[..., dict[int, Any]]


@pytest.fixture
def covered(area: Path, capsys: pytest.CaptureFixture[str]) -> Covered:
    """By tag, what `uavrt coverage` tells of a weak tag in the area."""

    def of(flight: Path, **options: Any) -> dict[int, Any]:
        capsys.readouterr()
        coverage(flight, tag_power=-62.0, area=area, cell=100.0, as_json=True, **options)
        return {one["tag_id"]: one for one in json.loads(capsys.readouterr().out)}

    return of


@pytest.fixture
def area(flight: Path, tmp_path: Path) -> Path:
    corners = around(flight, 600.0)
    path = tmp_path / "area.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [[*corners, corners[0]]]}))
    return path


def test_the_report_maps_where_each_tag_would_have_been_heard(
    flight: Path, tmp_path: Path
) -> None:
    report(flight, tag_power=-60.0, pdf=False, output=tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    first, second = (tag.tag_id for tag in read_flight(flight).info.tags)
    assert page.count("would be detected</h2>") == 2
    assert "confirmed pulses)" in page
    assert "not detected: where the map is yellow" in page
    assert "the ground is assumed to be level" in page
    assert f"Where tag {first}" in page
    assert f"Where tag {second}" in page


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
    flight: Path, tag: Tag, *, searched: dict[str, Any] | None = None, **fields: Any
) -> None:
    """Write what a whole flight said of a tag: it was not found, unless told otherwise."""
    usual: dict[str, Any] = {
        "found": False,
        "false_alarm_probability": 0.6,
        "interval_s": tag.pulse_intervals_s[0],
        "frequency_hz": tag.frequency_hz,
    }
    if searched is not None:
        made = searched_for(tag, WholeFlightOptions(pattern=pattern_named("RA-23K")))
        usual["searched"] = replace(made, **searched)
    verdict = IntegratedVerdict(tag_id=tag.tag_id, **(usual | fields))
    write_integrated(flight, [verdict], [])


@pytest.mark.usefixtures("undrawn")
def test_silence_over_the_whole_flight_tells_more_than_that_of_groups(
    flight: Path, silent: Tag, covered: Covered, tmp_path: Path
) -> None:
    before = covered(flight)[silent.tag_id]
    assert not before["whole_flight"]
    assert any("uavrt integrate" in text for text in before["limitations"])
    hindsight(flight, silent)
    told = covered(flight)
    after = told.pop(silent.tag_id)
    assert after["whole_flight"]
    assert after["mean_probability"] > before["mean_probability"]
    assert after["not_here"] > before["not_here"] > 1.0 - before["prior"]
    report(flight, tag_power=-62.0, pdf=False, output=tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Would be found over the whole flight" in page
    (heard,) = told.values()
    assert heard["heard_pulses"] > 0


def test_silence_says_nothing_of_the_time_without_samples(
    flight: Path, silent: Tag, covered: Covered
) -> None:
    poses = read_flight(flight).poses
    begin, length_ns = poses[0].time_ns, poses[-1].time_ns - poses[0].time_ns
    not_here = []
    for share in (1.0, 0.3, 0.02):
        listened = iso_intervals([(begin, begin + round(share * length_ns))])
        hindsight(flight, silent, listened=listened)
        told = covered(flight)[silent.tag_id]
        not_here.append(told["not_here"])
        missing = [text for text in told["limitations"] if "samples exist" in text]
        assert len(missing) == (share < 1.0)
    assert not_here[0] > not_here[1] > not_here[2] == pytest.approx(1.0 - told["prior"])
    # Asked for fewer false alarms than the map reckons with, it is no silence either.
    hindsight(flight, silent, false_alarm_probability=0.003)
    assert covered(flight)[silent.tag_id]["not_here"] is None
    hindsight(flight, silent, listened="noon/one")
    with pytest.raises(FormatError, match="integrate again"):
        covered(flight)


@pytest.mark.parametrize(
    ("fields", "says", "refused"),
    [
        ({"found": True, "false_alarm_probability": 1e-4}, "", "was detected"),
        ({"ambiguous": True}, "may come from this tag", "its absence cannot be shown"),
    ],
    ids=["found", "another train"],
)
def test_a_tag_found_in_hindsight_or_that_may_be_another_train_is_not_silent(
    flight: Path,
    silent: Tag,
    covered: Covered,
    fields: dict[str, Any],
    says: str,
    refused: str,
) -> None:
    hindsight(flight, silent, **fields)
    told = covered(flight)[silent.tag_id]
    assert told["in_hindsight"] == fields.get("found", False)
    assert told["not_here"] is None
    assert says in " ".join(told["limitations"])
    jobs, wanted = CoverageMapJobs(), {"tag_id": silent.tag_id, "tag_power_dbm": -62}
    asked = CoverageMapRequest.from_request(flight, ANTENNA, wanted)
    answer = answered(jobs, asked)
    assert (answer["state"], answer["in_hindsight"]) == ("done", told["in_hindsight"])
    with pytest.raises(UsageError, match=refused):
        jobs.absence(asked, wanted | {"outline": around(flight, 600.0)})


@pytest.mark.parametrize(
    ("searched", "why"),
    [
        ({"frequency_window_hz": 2.0}, "frequencies within 2 Hz of the listed one"),
        ({"frequency_hz": 148.6e6}, "a frequency, pulse width"),
        ({"antenna": "of another computer"}, "the map is for RA-23K"),
    ],
)
def test_a_search_of_less_than_the_tag_may_be_is_no_silence(
    flight: Path, silent: Tag, covered: Covered, searched: dict[str, Any], why: str
) -> None:
    by_groups = covered(flight)[silent.tag_id]
    hindsight(flight, silent, searched=searched)
    told = covered(flight)[silent.tag_id]
    assert not told["whole_flight"]
    assert told["mean_probability"] == by_groups["mean_probability"]
    assert why in " ".join(told["limitations"])
    assert "integrate again" in " ".join(told["limitations"])


def test_a_list_that_allows_more_than_was_searched_is_no_silence(
    flight: Path, silent: Tag, covered: Covered, tmp_path: Path
) -> None:
    hindsight(flight, silent, searched={})
    wider = replace(silent, interval_uncertainty_s=0.06, interval_jitter_s=0.02)
    write_tags(tmp_path / "tags.toml", [wider])
    (told,) = covered(flight, tags=tmp_path / "tags.toml").values()
    assert not told["whole_flight"]
    assert "but the tag's may differ by 60 ms" in " ".join(told["limitations"])
    assert "but they may be 20 ms off" in " ".join(told["limitations"])


def test_silence_is_that_of_the_search_that_was_made(
    flight: Path, silent: Tag, covered: Covered
) -> None:
    not_here = []
    for searched in ({}, {"frequency_window_hz": 1800.0}, {"most_drift": 0.05}):
        hindsight(flight, silent, searched=searched)
        told = covered(flight)[silent.tag_id]
        assert told["whole_flight"]
        assert told["antenna"] == "RA-23K"
        not_here.append(told["not_here"])
    # The more is looked for, the more of it noise shows by chance: weak tags are heard less.
    assert not_here[0] > max(not_here[1:])
    hindsight(flight, silent, searched={"antenna": "RA-2A"})
    told = covered(flight)[silent.tag_id]
    assert told["whole_flight"]
    assert told["antenna"] == "RA-2A"
    hindsight(flight, silent)
    told = covered(flight)[silent.tag_id]
    assert "did not record" in " ".join(told["limitations"])


def test_where_nothing_tells_that_a_detector_ran_silence_is_not_called_sure(
    write_flight: WriteFlight, covered: Covered
) -> None:
    """Poses alone are no listening: the flight had no samples, no reports and no pulses."""
    listening, deaf = write_flight(tags=2, heard=1), write_flight(tags=2, heard=0)
    sql(deaf, "DELETE FROM search_reports")
    for flight, ran in ((listening, True), (deaf, False)):
        records = covered(flight)
        assert len(records) == 2
        for told in records.values():
            doubted = "no record shows that a detector ran" in " ".join(told["limitations"])
            assert doubted == (not ran)
            assert ran or told["sure_within_m"] is None


def test_an_antenna_that_nobody_told_is_told_as_assumed(flight: Path, covered: Covered) -> None:
    assert read_flight(flight).settings_json is None
    for one in covered(flight).values():
        assert "RA-23K assumed" in " ".join(one["limitations"])
