"""A whole flight through the page, in a real browser, against the simulated world.

Debian's Chromium, driven by Playwright. With the environment variable UAVRT_SCREENSHOTS set to
a directory, each view is saved there as a picture (``make screenshots``).
"""

import json
import re
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args
from urllib.parse import urlsplit

import made
import pytest
from film import file_tree, log_lines
from page_driver import (
    SCREENSHOTS,
    VIDEO,
    WAIT_MS,
    Scene,
    Watched,
    type_row,
    type_tags,
    write_map,
)
from playwright.sync_api import Browser, Page, expect
from quiet_radio import QuietRadio
from tests.flight.conftest import FLIGHT_RATE_HZ

from uavrt.cli.computer.bench import bench_findings
from uavrt.config.settings import RecordingSettings
from uavrt.core.commands import Generation
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.link.tunnel.own_messages.live_bearing import BEARING_TYPE, encode_bearing
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.scene.demo_world import demo_scenario

CODED_TAG = made.simulated_tag(
    30,
    148_640_000.0,
    2.3,
    name="bat",
    pulse_width_s=0.0025,
    interval_uncertainty_s=0.004,
    gaps_s=(0.026, 0.054, 0.031),
    k=10,
    north_m=200.0,
    erp_dbm=-30.0,
)
FLIGHT_S = 100.0 if SCREENSHOTS or VIDEO else 50.0
NOW = "() => window.uavrt.store.pulseNowNs()"

TIMEOUT_S = 1500 if VIDEO else 400
"""A browser that is filmed on two busy cores takes its time, and then the film is encoded."""

pytestmark = [pytest.mark.slow, pytest.mark.timeout(TIMEOUT_S)]


def fall_silent(page: Page, radio: QuietRadio) -> None:
    """Lose the radio link alone: the page says so, and nothing of that time is lost."""
    flight = "() => window.uavrt.store.state.flight.flight_id"
    was, begun_ns = page.evaluate(flight), page.evaluate(NOW)
    radio.silent = True
    expect(page.locator("#banner")).to_contain_text("No contact with the drone")
    expect(page.locator("#chip-link")).to_have_text("no link")
    expect(page.locator("#chip-state")).to_have_text("No drone")
    assert page.evaluate("() => window.uavrt.store.online")
    expect(page.locator("#act-stop")).to_have_attribute("aria-disabled", "true")
    silent = f"(time) => time > {begun_ns} + 1e9 && time < {page.evaluate(NOW)} - 1e9"
    radio.silent = False
    expect(page.locator("#banner")).to_be_hidden()
    expect(page.locator("#chip-state")).to_have_text("Detecting")
    page.wait_for_function(
        f"() => window.uavrt?.store.pulses.get('time').filter({silent}).length > 0"
    )
    assert page.evaluate(flight) == was


def show_where_the_data_are(watched: Watched, drone: Any) -> None:
    """For the film: what the drone has recorded, and fetched by the telemetry link."""
    page = watched.page
    begun = log_lines(drone.directory / "supervisor.log", 99)
    watched.caption("What the drone did: one process for each task, ended by Stop.", 0)
    watched.card([line for line in begun if "started" in line or "state" in line][-14:])
    flight = min((drone.directory / "flights").glob("flight_log_*"))
    watched.caption("The flight lies on the drone, as the original laid it out …", 0)
    watched.card([f"$ ls -R {flight.name}", *file_tree(flight)], 8)
    watched.caption("… and comes over the same link, without a keyboard at the drone.", 1)
    page.click("#tab-flights")
    page.click("#drone-list")
    page.click(f'[data-remote="{flight.name}"] .fetch')
    expect(page.locator("#download-text")).to_contain_text(" of ")
    watched.caption("… and comes over the same link, without a keyboard at the drone.", 4)
    with watched.cut():
        expect(page.locator("#download-text")).to_contain_text(
            "downloaded", timeout=6 * WAIT_MS
        )
    watched.caption("", 1)


def test_a_whole_flight_is_flown_through_the_page(
    browser: Browser, scene: Scene, drone_bay: Any, quiet_radio: Callable[..., QuietRadio]
) -> None:
    scene.link_port = 0
    watched = scene.watch(plain_map=False)
    page, ground, here = watched.page, scene.ground, scene.directory
    scenario = demo_scenario(FLIGHT_S, 1)
    if not (SCREENSHOTS or VIDEO):
        radio_here = replace(scenario.radio, sample_rate_hz=FLIGHT_RATE_HZ)
        scenario = replace(scenario, radio=radio_here, tag=(*scenario.tag, CODED_TAG))

    watched.film()
    watched.caption("On the laptop: one command starts the ground station.", 0)
    watched.card(["$ uavrt ground", f"The page is at {ground.address} – Ctrl-C ends"])
    watched.caption("The whole ground station is this page. No internet.")
    # Set-up: the mistake is told at its field, and saved is only what is right.
    type_tags(page, scenario)
    first = page.locator('input[data-row="0"][data-key="frequency_mhz"]')
    right = first.input_value()
    first.fill("148612000")
    watched.caption("Tags, in MHz and ms as their sheets say; mistakes are told.", 3)
    page.click("#tag-save")
    expect(page.locator("#tag-table .fault").first).to_contain_text("looks like Hz")
    expect(first).to_have_attribute("aria-invalid", "true")
    watched.picture("setup-fault")
    first.fill(right)
    page.click("#tag-save")
    expect(page.locator("#tag-state")).to_have_text("saved")

    # Before the drone is there, buttons say why they do nothing.
    page.click("#tab-check")
    drone_row = page.locator('[data-check="drone"]')
    expect(drone_row).to_have_attribute("data-ok", "false")
    expect(drone_row.locator(".check-remedy")).to_contain_text("power")
    page.click("#tab-fly")
    expect(page.locator("#act-start")).to_have_attribute("aria-disabled", "true")

    watched.caption("Radio, autopilot and animals are simulated; the rest is real.")
    recording = RecordingSettings(
        directory=str(here / "drone1" / "flights"), capture_s=1.0, minimum_free_mb=1.0
    )
    drone = drone_bay.launch(scenario, recording=recording)
    if VIDEO:
        # Connection and recorder run all the time, the others while it detects.
        watched.caption("On the drone: one command, or a service that starts with it.", 3)
        watched.card(["$ uavrt run", *log_lines(drone.directory / "supervisor.log")])
    link_port = free_udp_port()
    radio = quiet_radio(drone.ground_port, link_port)
    page.click("#tab-setup")
    page.fill("#link-address", f"udpin://127.0.0.1:{link_port}")
    page.click("#link-connect")
    expect(page.locator("#link-state")).to_have_text("drone connected", timeout=WAIT_MS)
    watched.picture("setup")

    page.click("#tab-fly")
    watched.caption("1. Send the tags. Each message is acknowledged.")
    page.click("#act-send_tags")
    expect(page.locator("#act-send_tags")).to_contain_text("Tags sent", timeout=WAIT_MS)
    watched.caption("2. Start. The drone takes off and turns on the spot.")
    page.click("#act-start")
    expect(page.locator("#chip-state")).to_have_text("Detecting", timeout=WAIT_MS)

    # Pulses, the map with them, a bearing, and the way to the tag.
    for tag in scenario.tags:
        card = page.locator(f'.card[data-tag="{tag.tag_id}"]')
        expect(card).to_have_attribute("data-fresh", "live", timeout=WAIT_MS)
    if CODED_TAG in scenario.tag:
        facts = page.locator('.card[data-tag="30"]')
        expect(facts).to_contain_text(re.compile(r"Bursts\d+, .*Gaps26\.\d 5\d\.\d 3\d\.\d ms"))
    # The list before a first flight: the page and the drone's own computer agree.
    page.click("#tab-check")
    expect(page.locator('.check-row[data-ok="true"]')).to_have_count(7)
    # Nobody has flown with this drone before: what noise is normal nobody knows.
    expect(page.locator('.check-row.open[data-check="noise"]')).to_contain_text(
        "there is no past flight"
    )
    # In the air nobody is told to put the propellers on.
    expect(page.locator("#check-sum")).to_contain_text("The vehicle is armed")
    watched.picture("check")
    on_board = bench_findings(drone.settings)
    assert [one.what for one in on_board if not one.ok] == ["noise"]
    assert [one.what for one in on_board if one.open] == ["noise"]
    page.click("#tab-fly")
    drawn = "() => window.uavrt.map().querySourceFeatures('pulses').length > 5"
    page.wait_for_function(drawn, timeout=WAIT_MS)
    watched.caption("Pulses appear where the drone was, coloured by strength.", 5)
    page.wait_for_selector(".rose", timeout=WAIT_MS)
    watched.caption("3. From the third pulse of a turn: a rose and a bearing.", 5)
    page.click("#act-mark")
    page.wait_for_function("() => window.uavrt?.store.positions.length > 0", timeout=WAIT_MS)
    expect(page.locator("#walk-place")).to_contain_text("35.1")
    watched.caption("Position of the tag, in digits to be read aloud.", 5)
    page.click('[data-format="mgrs"]')
    expect(page.locator("#walk-place")).to_contain_text("12S VD")
    page.click('[data-format="decimal"]')

    # A reload, and a second browser: the same flight.
    before = page.evaluate("() => window.uavrt.store.pulses.count")
    page.reload()
    page.wait_for_function(f"() => window.uavrt?.store.pulses.count >= {before}")
    second = scene.watch(color_scheme="dark", plain_map=not SCREENSHOTS)
    second.page.wait_for_function(f"() => window.uavrt?.store.pulses.count >= {before}")
    second.page.wait_for_selector(".rose", timeout=WAIT_MS)

    # The server is killed and comes back: the page goes on by itself, nothing is missing.
    watched.caption("The ground station is killed in flight …", 3)
    ground.kill()
    expect(page.locator("#banner")).to_contain_text("does not answer")
    scene.start(port=ground.port)
    expect(page.locator("#banner")).to_be_hidden(timeout=WAIT_MS)
    expect(page.locator("#chip-state")).to_have_text("Detecting", timeout=WAIT_MS)
    page.wait_for_function(
        f"() => window.uavrt?.store.pulses.count > {before}", timeout=WAIT_MS
    )

    watched.caption("… and started again: the page goes on, no pulse is missing.", 5)
    watched.caption("The radio falls silent …", 2)
    fall_silent(page, radio)
    watched.caption("… and is back: the drone has kept its pulses, and sends them.", 5)
    page.wait_for_function(
        "() => window.uavrt?.store.bearings.some((one) => one.turn >= 1)",
        timeout=2 * WAIT_MS + 1000 * FLIGHT_S,  # a busy machine makes both slow
    )
    page.keyboard.press("f")
    watched.picture("fly")
    second.page.keyboard.press("f")
    second.picture("fly-dark")
    page.click("#tab-plots")
    expect(page.locator("#polar circle.polar-dot").first).to_be_visible()
    watched.picture("plots")

    page.click("#tab-fly")
    watched.caption("4. Stop.", 2)
    page.click("#act-stop")
    expect(page.locator("#chip-state")).to_have_text("Ready", timeout=WAIT_MS)

    # Samples as they are, and the drone's own settings.
    page.click("#act-capture")
    expect(page.locator("#chip-state")).to_have_text("Recording raw data", timeout=WAIT_MS)
    expect(page.locator("#chip-state")).to_have_text("Ready", timeout=WAIT_MS)
    assert list(here.glob("drone1/flights/*/iq/*.sigmf-meta"))
    page.click("#tab-setup")
    page.click("#parameters-read")
    gain = page.locator('[data-parameter="RADIO_GAIN"]')
    gain.fill("12")
    gain.press("Enter")
    expect(page.locator("#drone-note")).to_have_text("RADIO_GAIN = 12", timeout=WAIT_MS)
    watched.picture("drone")
    page.click("#tab-log")
    page.fill("#log-text", "nest seen")
    expect(page.locator(".log-line")).to_have_count(1)
    page.fill("#log-text", "")
    watched.picture("log")

    if VIDEO:
        show_where_the_data_are(watched, drone)

    # The flight is a flight: listed, exported, looked at again.
    watched.caption("5. The flight is kept: replay, report, files for other programs.")
    page.click("#tab-flights")
    # The newer one holds the capture, without pulses.
    received = page.locator("tr[data-flight]", has_text="received by this station")
    expect(received).to_have_count(2)
    row = received.last
    watched.picture("flights")
    with page.expect_download() as download:
        row.locator("text=GEOJSON").click()
    collection = json.loads(Path(download.value.path()).read_text())
    layers = {feature["properties"]["layer"] for feature in collection["features"]}
    assert {"track", "pulse", "bearing", "position", "region 95 %", "mark"} <= layers
    with watched.cut():
        with page.expect_popup(timeout=4 * WAIT_MS) as popup:
            row.locator(".report").click()
        report = popup.value
        expect(report.locator("body")).to_contain_text("lynx", timeout=4 * WAIT_MS)
        report.close()
    row.locator(".open-flight").click()
    expect(page.locator("#banner")).to_contain_text("Past flight")
    slider = page.locator("#replay-slider")
    slider.fill("300")
    shown = page.evaluate("() => [window.uavrt.store.shown(), window.uavrt.store.pulses.count]")
    assert 0 < shown[0] < shown[1]
    watched.picture("replay")
    watched.caption("Every moment can be looked at again.")
    watched.caption("", 1)
    watched.save_film(browser)
    page.click("#replay-live")
    expect(page.locator("#banner")).to_be_hidden()

    # All that was shown is on the disk, and nobody else was asked for anything.
    # Without what the film has fetched, which ends with _drone.
    directory = min(scene.here.glob("flight_log_*[0-9]"))
    recorded = read_flight(directory)
    assert len(recorded.pulse_poses) == shown[1]
    if CODED_TAG in scenario.tag:
        bursts = [one.pulse for one in recorded.pulse_poses if one.pulse.tag_id == 30]
        assert len(bursts) > 5
        assert all(len(burst.burst_starts_ns) >= 3 for burst in bursts)
    assert any("nest seen" in text for _, text in recorded.notes)
    for each in (watched, second):
        assert each.hosts - {"blob", "data"} == {urlsplit(ground.address).netloc}


def test_the_drones_own_bearing_is_marked_and_every_generation_can_be_chosen(
    scene: Scene,
) -> None:
    page = scene.watch(plain_map=False).page
    options = page.locator("#set-generation option")
    told = options.evaluate_all("(all) => all.map((one) => one.value)")
    assert set(told) == set(get_args(Generation))
    expect(page.locator("#legend-on-board")).to_be_hidden()
    bearing = made.live_bearing(
        2,
        start_time_ns=1_700_000_000_000_000_000,
        end_time_ns=1_700_000_030_000_000_000,
        bearing_deg=42.0,
        sigma_deg=6.0,
        interval90_deg=(32.0, 52.0),
    )
    payload = encode_bearing(bearing)
    tunnel = made.tunnel(BEARING_TYPE, payload)
    page.evaluate("() => window.uavrt.store.select(2)")
    with present(scene.link_port) as say:
        expect(page.locator("#chip-state")).to_have_text("Drone connected")
        say(tunnel)
    expect(page.locator("#legend-on-board")).to_be_visible()
    mark = page.locator(".on-board")
    expect(mark).to_have_attribute("aria-label", re.compile("42 degrees.*on the drone"))


@contextmanager
def present(port: int) -> Iterator[Callable[[Message], None]]:
    """The drone's component 191 is there, beats, and says what it is given."""
    writer, over, one_at_a_time = FrameWriter(1, 191), threading.Event(), threading.Lock()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", port))

        def say(message: Message) -> None:
            with one_at_a_time:
                sock.send(writer.encode(message))

        def beat() -> None:
            while not over.wait(0.3):
                say(made.heartbeat())

        beating = threading.Thread(target=beat)
        beating.start()
        try:
            yield say
        finally:
            over.set()
            beating.join()


def test_names_and_texts_are_never_markup_and_maps_come_from_the_folder(scene: Scene) -> None:
    evil = "<img src=x onerror=alert(1)>"
    folder = scene.here / "maps"
    folder.mkdir()
    write_map(folder / "valley.mbtiles")
    watched = scene.watch(plain_map=False)
    page = watched.page
    page.click("#tab-setup")
    page.click("#tag-add")
    type_row(page, name=evil, frequency_mhz=148.7, interval_ms=1254, pulse_width_ms=20)
    page.click("#tag-save")
    expect(page.locator("#tag-state")).to_have_text("saved")
    page.click("#tab-fly")
    expect(page.locator(".tag-name")).to_have_text(f"2 {evil}")
    with present(scene.link_port) as say:
        expect(page.locator("#chip-state")).to_have_text("Drone connected")
        say(dialect.Statustext(severity=3, text=evil))
        watched.toasted(evil)
    page.click("#tab-log")
    expect(page.locator(".log-said").first).to_have_text(evil)
    assert page.locator("#main img").count() == 0

    # The map of the folder lies below, its tiles come from this server.
    page.click("#tab-fly")
    with page.expect_request("**/maps/valley.mbtiles/**"):
        page.evaluate("() => window.uavrt.map().jumpTo({ center: [8, 46.5], zoom: 3 })")
    page.click(".layers summary")
    expect(page.locator("#basemap")).to_have_value("valley.mbtiles")
    page.select_option("#basemap", "")
    page.wait_for_function("() => !window.uavrt.map().getSource('base')")

    # By keys alone: views, theme; every control has a name.
    page.keyboard.press("Escape")
    page.locator("#main").focus()
    page.keyboard.press("2")
    expect(page.locator("#view-plots")).to_be_visible()
    before = page.evaluate("() => document.documentElement.dataset.theme")
    page.keyboard.press("d")
    assert page.evaluate("() => document.documentElement.dataset.theme") != before
    nameless = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, a")].filter((one) =>
          !(one.textContent.trim() || one.getAttribute("aria-label") || one.title ||
            one.closest("label"))).map((one) => one.outerHTML)"""
    )
    assert nameless == []
    assert watched.hosts - {"blob", "data"} == {urlsplit(scene.ground.address).netloc}
