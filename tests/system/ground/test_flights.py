"""The page's report is made by a program of its own."""

import asyncio
from pathlib import Path

from tests.unit.ground.test_flights import flown_fixture, stored  # noqa: F401  # a fixture

from uavrt.ground.store.estimates import AntennaChoice, Estimator
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.web.work.report_jobs import Reporter


def test_the_pages_report_has_what_the_page_tells_of_the_antenna_that_is_set(
    flown: FlightKeeper, tmp_path: Path
) -> None:
    library, flight_id = stored(flown)
    columns, place = library.columns(flight_id), library.path(flight_id)
    reporter = Reporter(tmp_path / "reports")
    tags = library.summary(flight_id).tags
    usual, found = (
        Estimator().estimate(columns, antenna, (), tags)
        for antenna in (AntennaChoice(), AntennaChoice(offset_deg=90.0, heading_sigma_deg=15.0))
    )
    antenna = AntennaChoice(offset_deg=90.0, heading_sigma_deg=15.0)
    page = asyncio.run(reporter.report(place, antenna)).decode().replace("\u00a0", " ")
    told = [f"{one.positions[0]['radius95_m']:.0f} m (95 %)" for one in (usual, found)]
    assert told[0] not in page
    assert told[1] in page
    assert f"{found.bearings[0]['bearing_deg']:.0f}°" in page
