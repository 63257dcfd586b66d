"""A survey with a monopole in the page: the strength over the ground, at each height flown."""

import math
from pathlib import Path

import made
import numpy as np
import pytest
from page_driver import Scene, open_flight
from playwright.sync_api import Page, expect
from some import some
from until import until

from uavrt.analysis.estimates.positions import read_positions
from uavrt.core.clock import Clock
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import PulsePose
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.localization.estimates.flight_estimates import EstimationOptions

PLANE = TangentPlane(latitude_deg=46.5, longitude_deg=8.0)
EAST_M, NORTH_M = 140.0, 190.0
"""Where the tag is."""
LOW_M, HIGH_M = 30.0, 90.0


def write_survey(directory: Path) -> str:
    """Record lines over a square of 300 m at two heights; heard with an upright monopole."""
    tag = made.tag(2, 148_712_000.0, 1.5, name="frog")
    keeper = FlightKeeper(directory, Clock.start())
    flight_id = keeper.begin([tag])
    time_ns = keeper.start_time_ns
    rng = np.random.default_rng(2)
    for height in (LOW_M, HIGH_M):
        for line, east in enumerate(np.arange(0.0, 301.0, 50.0)):
            for along in np.arange(0.0, 301.0, 9.0):
                north = along if line % 2 == 0 else 300.0 - along
                time_ns += 1_500_000_000
                latitude, longitude = PLANE.to_geodetic(east, north)
                pose = made.pose(
                    time_ns,
                    latitude,
                    longitude,
                    altitude_relative_m=height + float(rng.uniform(-1.0, 1.0)),
                    altitude_amsl_m=500.0 + height,
                )
                ground = math.hypot(east - EAST_M, north - NORTH_M)
                slant = math.hypot(ground, height)
                snr_db = 30.0 - 25.0 * math.log10(slant / 100.0)
                snr_db += 20.0 * math.log10(max(ground / slant, 0.1))
                pulse = made.pulse(time_ns, frequency_hz=tag.frequency_hz, snr_db=snr_db)
                keeper.add_pose(pose)
                keeper.add_pulse(PulsePose(pulse=pulse, pose=pose))
    keeper.close()
    return flight_id


def shown_at(page: Page, east_m: float, north_m: float) -> list[int]:
    """Red, green, blue, opacity of the strength that is drawn at a place."""
    latitude, longitude = PLANE.to_geodetic(east_m, north_m)
    found: list[int] = page.evaluate(
        """([lon, lat]) => {
          const source = window.uavrt.map().getSource("strength");
          const [[left, top], , [right, bottom]] = source.coordinates;
          const canvas = source.getCanvas();
          const x = Math.floor(((lon - left) / (right - left)) * canvas.width);
          const y = Math.floor(((top - lat) / (top - bottom)) * canvas.height);
          return [...canvas.getContext("2d").getImageData(x, y, 1, 1).data];
        }""",
        [float(longitude), float(latitude)],
    )
    return found


def strongest_m(page: Page) -> float:
    """How far the place that the page names is from the tag."""
    text = page.locator("#walk-place").inner_text()
    east, north = PLANE.to_local(*map(float, text.split(",")))
    return math.hypot(float(east) - EAST_M, float(north) - NORTH_M)


@pytest.fixture(scope="module")
def survey(lasting: Scene) -> str:
    return write_survey(lasting.here)


def test_the_strength_of_each_height_is_seen_by_itself(station: Scene, survey: str) -> None:
    watched = station.watch(plain_map=False)
    page = watched.page
    open_flight(page, survey)
    expect(page.locator("#walk-title")).to_contain_text("strongest signal")
    page.click(".layers summary")
    expect(page.locator("#heights option")).to_have_text(
        ["all heights", "29–31\u202fm", "89–91\u202fm"]
    )
    page.uncheck("#layer-pulses")
    page.check("#layer-strength")
    page.wait_for_function("() => window.uavrt.map().getSource('strength')")
    page.select_option("#heights", "0")
    low, low_m = page.locator("#walk-place").inner_text(), strongest_m(page)
    page.select_option("#heights", "1")
    # The digits are asked for after the map is drawn.
    expect(page.locator("#walk-place")).not_to_have_text(low)
    # 0.9 of the height away from the tag: another place for each.
    assert low_m < 45.0
    assert 50.0 < strongest_m(page) < 110.0

    def weaker_above() -> bool:
        """Less green: it hears nothing straight below."""
        above, beside = (shown_at(page, EAST_M, NORTH_M - south) for south in (0.0, 80.0))
        return above[3] == beside[3] > 0 and above[1] < beside[1] - 10

    until(weaker_above)
    watched.picture("strength")
    page.select_option("#heights", "")
    page.wait_for_function("() => window.uavrt?.store.heights === null")
    # On a phone the position takes one line of the map until it is pressed.
    page.set_viewport_size({"width": 390, "height": 844})
    card = page.locator("#walk")
    until(lambda: some(card.bounding_box())["height"] <= 60.0)
    expect(page.locator("#walk-place")).to_be_visible()
    expect(page.locator("#walk-way")).to_be_hidden()
    page.click("#walk-unfold")
    expect(page.locator("#walk-way")).to_be_visible()
    page.click("#walk-unfold")
    # The layers, too, can be reached next to the replay's bar.
    page.click(".layers summary")
    expect(page.locator("#layer-strength")).to_be_hidden()
    page.click(".layers summary")
    page.click("#fit")
    watched.picture("phone")


def test_with_a_monopole_the_page_says_where_the_tag_is_as_the_command_line_does(
    station: Scene, survey: str
) -> None:
    watched = station.watch(plain_map=False)
    page = watched.page
    page.click("#tab-setup")
    page.select_option("#set-antenna", "monopole")
    page.wait_for_function("() => window.uavrt?.store.settings.antenna === 'monopole'")
    open_flight(page, survey)
    expect(page.locator("#walk-sure")).to_contain_text("(95\u202f%)")
    expect(page.locator(".fix")).to_have_count(1)
    (told,) = read_positions(station.here / survey, how=EstimationOptions(antenna="monopole"))
    assert told.position is not None
    latitude, longitude = map(float, page.locator("#walk-place").inner_text().split(","))
    assert latitude == pytest.approx(told.position.latitude_deg, abs=6e-6)
    assert longitude == pytest.approx(told.position.longitude_deg, abs=6e-6)
    assert strongest_m(page) < 30.0
    watched.picture("monopole")
