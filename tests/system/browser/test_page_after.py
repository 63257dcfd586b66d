"""A past flight in the page: what its samples say, and where a silent tag is not."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from page_driver import Scene, colour_at, open_flight
from past_flight import PLANE, TAG, write_flight
from playwright.sync_api import expect
from until import until

from uavrt.flight.integrated import (
    FlightFold,
    IntegratedPart,
    IntegratedVerdict,
    write_integrated,
)
from uavrt.flight.reading.flight_reader import read_flight

pytestmark = pytest.mark.timeout(240)
SILENT = replace(TAG, tag_id=4, name="fox", frequency_hz=148_752_000.0)
MISSING = replace(TAG, tag_id=6, name="owl", frequency_hz=148_792_000.0)


def integrated(directory: Path) -> None:
    """What uavrt integrate would have written: one found, one in two places, one not."""
    latitude, longitude = PLANE.to_geodetic(-200.0, 150.0)
    found = IntegratedVerdict(
        tag_id=4,
        found=True,
        false_alarm_probability=2e-5,
        interval_s=1.2003,
        frequency_hz=148_752_010.0,
        level_db=4.1,
        bearing_deg=307.0,
        arc50_deg=6.0,
        arc95_deg=18.0,
        latitude_deg=float(latitude),
        longitude_deg=float(longitude),
        radius50_m=40.0,
        radius95_m=95.0,
        pulses=24,
        heard_live=0,
    )
    missing = IntegratedVerdict(
        tag_id=6,
        found=False,
        false_alarm_probability=0.41,
        interval_s=1.19,
        frequency_hz=148_792_000.0,
        remarks="the elevation files do not cover the flight: the ground is assumed to be "
        "level",
    )
    beside = [PLANE.to_geodetic(east, 100.0) for east in (-300.0, 300.0)]
    twice = replace(
        found,
        tag_id=2,
        places=2,
        radius95_m=2600.0,
        parts=tuple(
            IntegratedPart(
                latitude_deg=float(lat),
                longitude_deg=float(lon),
                radius95_m=80.0,
                probability=0.49,
            )
            for lat, lon in beside
        ),
        region95=tuple(
            tuple(
                (float(lat) + north, float(lon) + east)
                for north, east in ((0, 0), (0, 1e-3), (1e-3, 1e-3), (1e-3, 0), (0, 0))
            )
            for lat, lon in beside
        ),
    )
    fold = FlightFold(
        tag_id=4,
        interval_s=1.2003,
        length_s=300.0,
        profile=(0.0, 7.0, 0.0),
        raster=((0.0, 5.0, 0.0), (0.0, 5.0, 0.0)),
    )
    heard = read_flight(directory).pulse_poses[::3]
    pulses = [
        replace(
            one,
            pulse=replace(one.pulse, tag_id=4, detection_status="integrated", confirmed=False),
        )
        for one in heard
    ]
    write_integrated(directory, [twice, found, missing], pulses, [fold])


def test_after_the_landing_the_page_tells_of_hindsight_and_of_silence(scene: Scene) -> None:
    here = scene.here
    flight = write_flight(here, 120.0, 300.0, (SILENT, MISSING))
    integrated(here / flight)
    watched = scene.watch()
    page = watched.page
    expect(page.locator("#show-after")).to_be_hidden()
    open_flight(page, flight)
    page.click("#show-after")
    verdicts = page.locator("#verdicts li")
    expect(verdicts).to_have_count(3)
    expect(verdicts.nth(0)).to_contain_text("in one of 2 places that all fit the flight:")
    expect(verdicts.nth(0)).to_contain_text("within 80 m (49")
    expect(page.locator("#verdicts img.fold")).to_have_count(1)
    expect(page.locator("#integrate-begin")).to_be_hidden()
    expect(verdicts.nth(1)).to_contain_text("Tag 4 foxWhole flightfound")
    expect(verdicts.nth(1)).to_contain_text("one of 50,000 flights")
    expect(verdicts.nth(1)).to_contain_text("24 found after the flight")
    expect(verdicts.nth(1)).to_contain_text("95 m (95 %)")
    expect(verdicts.nth(2)).to_contain_text("Tag 6 owlWhole flightnot found")
    expect(verdicts.nth(2)).to_contain_text("do not cover the flight")
    watched.picture("after")

    page.select_option("#silence-tag", "6")
    page.fill("#silence-power", "much")
    page.click("#silence-make")
    expect(page.locator("#silence-fault")).to_contain_text("must be a number")
    page.fill("#silence-power", "-62")
    page.click("#silence-make")
    told = page.locator("#silence-status")
    expect(told).to_contain_text("on average", timeout=60_000)
    expect(told).to_contain_text("without --dem, the ground is assumed to be level")
    box = page.locator("#map").bounding_box()
    assert box is not None
    page.click("#absence-draw")
    for right, down in ((0.35, 0.4), (0.6, 0.4), (0.6, 0.7), (0.35, 0.7)):
        page.mouse.click(box["x"] + right * box["width"], box["y"] + down * box["height"])
        page.wait_for_timeout(350)  # two quick taps zoom
    absence = page.locator("#absence-status")
    expect(absence).to_contain_text(re.compile(r"not in this area: (> )?0\.\d{3}"))
    at = (round(box["x"] + 0.3 * box["width"]), round(box["y"] + 0.3 * box["height"]))
    # Bare ground is #eef2f3: the map lies on it.
    until(lambda: colour_at(page, *at)[0] < 200)
    watched.picture("silence")

    # A tag that was heard is not judged by silence.
    page.select_option("#silence-tag", "2")
    page.click("#silence-make")
    expect(told).to_contain_text("on average", timeout=60_000)
    page.click("#absence-draw")
    for right, down in ((0.35, 0.4), (0.6, 0.4), (0.6, 0.7)):
        page.mouse.click(box["x"] + right * box["width"], box["y"] + down * box["height"])
        page.wait_for_timeout(350)
    expect(absence).to_contain_text("tag 2 was detected")
