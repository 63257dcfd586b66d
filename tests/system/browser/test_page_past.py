"""Past flights in the page: fetched from the drone, compared, exported; samples; map files."""

import io
import json
import socket
import zipfile
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from archived_pulses import archive
from file_drone import FileDrone
from page_driver import WAIT_MS, Scene, colour_at, write_vector_map
from past_flight import write_days, write_flight
from playwright.sync_api import Page, expect
from recorded import frames, write_recording
from some import some
from until import until

from uavrt.simulation.demo.demo_programs import free_udp_port

pytestmark = pytest.mark.timeout(240)
KEEP_PROGRESS = """() => {
  const said = document.querySelector("#download-text");
  window.progress = [];
  new MutationObserver(() => window.progress.push(said.textContent))
    .observe(said, { childList: true });
}"""
"""A busy test may look when all is there already."""


def exported(page: Page, row: str, name: str) -> bytes:
    """What a link of a flight's row gives."""
    assert page.locator(row).locator(f"a:text-is('{name}')").get_attribute("href") is not None
    with page.expect_download() as download:
        page.locator(row).locator(f"a:text-is('{name}')").click()
    return Path(download.value.path()).read_bytes()


def test_a_flight_is_starred_by_one_press_and_loses_the_star_by_another(station: Scene) -> None:
    here = station.here
    first, _ = write_flight(here, 120.0, 300.0), write_flight(here, 150.0, 300.0)
    watched = station.watch()
    page = watched.page
    page.click("#tab-flights")
    star = page.locator(f'tr[data-flight="{first}"] .star')
    expect(star).to_have_text("☆")
    star.click()
    expect(star).to_have_text("★")
    expect(star).to_have_attribute("aria-pressed", "true")
    assert (here / first / "starred").exists()
    box = until(star.bounding_box)
    assert box["x"] + box["width"] <= 1024, "in sight at 1024 x 600"
    page.click("#season-show")
    season = "2 flights in 4 minutes of flight time · 1 of 1"
    expect(page.locator("#season-note")).to_contain_text(season)
    expect(page.locator('[data-animal="2"]')).to_contain_text("2 lynx")
    watched.picture("star")
    page.reload()
    page.click("#tab-flights")
    expect(star).to_have_text("★")
    star.click()
    expect(star).to_have_text("☆")
    assert not (here / first / "starred").exists()


def test_many_flights_are_sought_by_tag_and_day_here_and_in_the_archive(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    here, without = scene.here, scene.directory / "without"
    names = write_days(here, 30)
    archive(here / "archive")
    (here / names[0]).rename(here / "03")  # in the archive, too
    without.mkdir()
    (without / "duckdb.py").write_text("raise ImportError(name='duckdb')\n")
    monkeypatch.setenv("PYTHONPATH", str(without))
    ground = scene.start()
    watched = scene.watch()
    page = watched.page
    rows, archived = page.locator("tr[data-flight]"), page.locator("tr[data-archived]")
    page.click("#tab-flights")
    # Without the package the archive says what to do, and the list goes on.
    expect(page.locator("#archive-list")).to_contain_text("pip install 'uavrt[batch]'")
    expect(rows).to_have_count(25)
    ground.stop()
    monkeypatch.delenv("PYTHONPATH")
    scene.start(port=ground.port)
    page.reload()
    page.click("#tab-flights")
    expect(archived).to_have_count(9)
    expect(page.locator("#flights-pager")).to_contain_text("1 to 25 of 30")
    page.get_by_label("Older flights").click()
    expect(rows).to_have_count(5)
    expect(page.locator("#flights-pager")).to_contain_text("26 to 30 of 30")
    page.fill("#flights-tag", "4")
    page.press("#flights-tag", "Enter")
    expect(rows).to_have_count(15)
    page.fill("#flights-from", "2026-05-04")
    expect(rows).to_have_count(1)
    expect(rows).to_contain_text("2026-05-04 12:00 UTC")
    expect(archived).to_have_count(0)
    # The archive's days are of another year; of tag 4 the sought pulses come first.
    page.fill("#flights-from", "1970-01-21")
    page.fill("#flights-to", "1970-01-31")
    expect(rows).to_have_count(0)
    expect(archived).to_have_count(2)
    expect(archived.first).to_contain_text("4 (2), 2 (3)")
    box = some(page.locator("#archive-list").bounding_box())
    assert box["x"] + box["width"] <= 1024
    assert box["y"] + box["height"] <= 600, "in sight at 1024 x 600"
    page.click('tr[data-archived="03"] .open-flight')
    expect(page.locator("#banner")).to_contain_text("Past flight")
    page.click("#tab-flights")
    page.click("#flights-all")
    expect(rows).to_have_count(25)
    assert page.evaluate("document.documentElement.scrollWidth") <= 1024


def test_flights_are_fetched_compared_and_exported(scene: Scene) -> None:
    here, on_drone = scene.here, scene.directory / "drone"
    on_drone.mkdir()
    first = write_flight(here, 120.0, 300.0)
    second = write_flight(here, 150.0, 300.0)
    remote = write_flight(on_drone, 120.0, 300.0)
    write_recording(on_drone / remote / "iq", 1.7)
    drone = FileDrone(scene.link_port, on_drone)
    try:
        watched = scene.watch(plain_map=False)
        page = watched.page
        page.click("#tab-flights")
        expect(page.locator("tr[data-flight]")).to_have_count(2)

        # Two side by side, then both on the map.
        for flight_id in (first, second):
            page.check(f'tr[data-flight="{flight_id}"] .tick')
        page.click("#flights-compare")
        cells = page.locator(".compared tbody tr").locator("td")
        expect(cells.last).to_contain_text("m", timeout=WAIT_MS)
        apart_m = float(cells.last.inner_text().split("\u202f")[0])
        assert 10.0 < apart_m < 60.0  # the truth: 30 m
        expect(cells.first).to_have_text("72")
        watched.picture("compare")
        page.click("#compare-map")
        expect(page.locator("#banner")).to_contain_text("dashed: flight of")
        page.wait_for_function(
            "() => window.uavrt.map().querySourceFeatures('other-fixes').length > 0",
            timeout=WAIT_MS,
        )
        # The digits are the position's, not those of the strongest pulse.
        expect(page.locator("#walk-place")).to_contain_text("46.502", timeout=WAIT_MS)
        watched.picture("compare-map")
        page.click("#replay-live")

        # Every export, each in its own form.
        page.click("#tab-flights")
        row = f'tr[data-flight="{first}"]'
        assert exported(page, row, "CSV").count(b"\n") == 73
        layers = {
            f["properties"]["layer"]
            for f in json.loads(exported(page, row, "GEOJSON"))["features"]
        }
        assert {"pulse", "bearing", "position"} <= layers
        with zipfile.ZipFile(io.BytesIO(exported(page, row, "KMZ"))) as archive:
            assert b"lynx" in archive.read(archive.namelist()[0])
        assert b"<gpx" in exported(page, row, "GPX")

        # From the drone, with its samples, in view of the progress.
        page.click("#drone-list")
        expect(page.locator(".remote")).to_have_count(1, timeout=WAIT_MS)
        page.check("#drone-samples")
        page.evaluate(KEEP_PROGRESS)
        page.click(f'[data-remote="{remote}"] .fetch')
        page.wait_for_function("() => window.progress.some((one) => one.includes(' of '))")
        watched.picture("download")
        expect(page.locator("#download-text")).to_contain_text(
            "downloaded", timeout=2 * WAIT_MS
        )
        fetched = page.locator(f'tr[data-flight="{remote}_drone"]')
        expect(fetched).to_contain_text("lynx")

        # Its samples as a waterfall; then a channel that comes live.
        fetched.locator(".open-flight").click()
        expect(page.locator("#banner")).to_contain_text("Past flight")
        page.click("#tab-plots")
        expect(page.locator("#waterfall-note")).to_contain_text(
            "listed frequency", timeout=WAIT_MS
        )
        page.wait_for_function(
            "() => Number(document.querySelector('#waterfall').dataset.columns) > 100",
            timeout=WAIT_MS,
        )
        page.locator("#waterfall").scroll_into_view_if_needed()
        watched.picture("waterfall")
        live = free_udp_port()
        page.fill("#waterfall-address", f"udp://127.0.0.1:{live}")
        page.click("#waterfall-live")
        expect(page.locator("#waterfall-note")).to_contain_text("Waiting for samples")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.connect(("127.0.0.1", live))
            for payload in frames(600.0, 8):
                sender.send(payload)
        page.wait_for_function(
            "() => Number(document.querySelector('#waterfall').dataset.columns) > 20",
            timeout=WAIT_MS,
        )
        assert watched.hosts - {"blob", "data"} == {urlsplit(scene.ground.address).netloc}
    finally:
        drone.close()


def test_a_vector_map_of_the_folder_is_drawn(station: Scene) -> None:
    folder = station.here / "maps"
    folder.mkdir(exist_ok=True)
    write_vector_map(folder / "sea.pmtiles")
    (folder / "broken.pmtiles").write_bytes(b"no map")
    watched = station.watch(plain_map=False)
    page = watched.page
    page.wait_for_function("() => window.uavrt.map().getLayer('base-fill-water')")
    page.evaluate("() => window.uavrt.map().jumpTo({ center: [8, 46.5], zoom: 3.4 })")
    page.wait_for_function(
        """() => new Promise((done) => {
          const map = window.uavrt.map();
          const look = () => map.loaded() &&
            map.querySourceFeatures("base", { sourceLayer: "water" }).length > 0
            ? requestAnimationFrame(() => done(true)) : setTimeout(look, 50);
          look();
        })""",
        timeout=WAIT_MS,
    )
    water = (0xC3, 0xDB, 0xE6)
    places = [(430, 330), (560, 430), (850, 260)]
    until(lambda: any(colour_at(page, *place) == water for place in places))
    page.click(".layers summary")
    expect(page.locator("#basemap option")).to_have_count(3)
    expect(page.locator("#basemap option", has_text="broken")).to_be_disabled()
    assert watched.hosts - {"blob", "data"} == {urlsplit(station.ground.address).netloc}


def test_a_slow_computer_pans_coarsely_and_shows_the_rest_sharp(station: Scene) -> None:
    watched = station.watch(plain_map=False)
    page = watched.page
    page.wait_for_function("() => window.uavrt.map().loaded()", timeout=WAIT_MS)
    full, least = page.evaluate(
        """async () => {
          const map = window.uavrt.map();
          const full = map.getPixelRatio();
          let least = full;
          for (let step = 0; step < 40; step += 1) {
            map.panBy([3, 0], { duration: 0 });
            const until = performance.now() + 40;
            while (performance.now() < until);
            await new Promise(requestAnimationFrame);
            least = Math.min(least, map.getPixelRatio());
          }
          return [full, least];
        }"""
    )
    assert least < full
    page.wait_for_function(f"() => window.uavrt.map().getPixelRatio() === {full}")
