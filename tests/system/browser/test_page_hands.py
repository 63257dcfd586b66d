"""A person's tasks on a tablet of 7 inches, and what goes wrong in hands."""

import re
import socket
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from held import Held
from page_driver import WAIT_MS, Scene, open_flight, type_row, type_tags, write_map
from past_flight import write_flight
from playwright.sync_api import Page, expect
from some import some
from until import until
from willing_drone import WillingDrone

from uavrt.core.commands import SystemState
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.scene.demo_world import demo_scenario

pytestmark = pytest.mark.timeout(240)

MANUAL = Path(__file__).parents[3] / "docs" / "how-to" / "use-the-ground-station.md"
NO_WEBGL = """() => {
  const real = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
    return kind.startsWith("webgl") ? null : real.call(this, kind, ...more);
  };
}"""
TARGETS = """() => [...document.querySelectorAll("button,select,summary,input,a.export,a.chip")]
  .filter((one) => one.checkVisibility() && !one.closest(".maplibregl-ctrl-attrib"))
  .map((one) => [one, one.matches("[type=checkbox],[type=file]") && one.closest("label")])
  .map(([one, label]) => [one.id || one.textContent, (label || one).getBoundingClientRect()])
  .filter(([, box]) => box.width && (box.width < 47.5 || box.height < 47.5))
  .map(([name, box]) => `${name}: ${Math.round(box.width)} × ${Math.round(box.height)}`)"""
OVERLAPS = """() => {
  const all = [...document.querySelectorAll("#top .tab, #top .chip, #top .tool")];
  const seen = all.filter((one) => one.checkVisibility());
  const boxes = seen.map((one) => [one.id || one.textContent, one.getBoundingClientRect()]);
  const cut = seen.filter((one) => one.scrollWidth > one.clientWidth + 1)
    .map((one) => `${one.id || one.textContent} is cut off`);
  const top = document.querySelector("#top").getBoundingClientRect();
  const out = boxes.filter(([, one]) => one.left < 0 || one.right > innerWidth ||
                                        one.bottom > top.bottom || top.height > 80)
    .map(([name]) => `${name} is outside`);
  const over = boxes.flatMap(([name, one], place) => boxes.slice(place + 1)
    .filter(([, two]) => one.right > two.left + 1 && two.right > one.left + 1 &&
                         one.bottom > two.top + 1 && two.bottom > one.top + 1)
    .map(([other]) => `${name} lies over ${other}`));
  return [...cut, ...out, ...over];
}"""


MOVING = (
    "turn the drone here",
    "see the path over an imported area",
    "fly the path that is shown",
    "take the drone back",
)
"""Tasks that `test_page_moves` counts: they need a drone that flies."""


class Hand:
    """Counts what a person presses."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.clicks = 0

    def click(self, place: str) -> None:
        self.clicks += 1
        self.page.locator(place).first.click()

    def choose(self, place: str, value: str) -> None:
        self.clicks += 1
        self.page.select_option(place, value)

    def give(self, place: str, *paths: Path) -> None:
        self.clicks += 1
        self.page.set_input_files(place, [str(path) for path in paths])

    def took(self) -> int:
        clicks, self.clicks = self.clicks, 0
        return clicks


def pins_are_seen(page: Page) -> None:
    """All positions, and the turns, lie in the frame and not below a box over the map."""
    frame, walk, replay = (
        some(page.locator(name).bounding_box()) for name in ("#map", "#walk", "#replay")
    )
    # All in one moment: the plain map draws its marks anew once a second.
    marks = "[...document.querySelectorAll('.fix-pin, .drone-marker')]"

    def seen() -> bool:
        """The map may still move there."""
        found = page.evaluate(f"{marks}.map((one) => one.getBoundingClientRect().toJSON())")
        return len(found) == 2 and all(
            frame["x"] < place["x"] < frame["x"] + frame["width"] - place["width"]
            and walk["y"] + walk["height"] < place["y"] < replay["y"] - place["height"]
            for place in found
        )

    until(seen)


@pytest.fixture(scope="module")
def past(lasting: Scene) -> tuple[str, WillingDrone]:
    """A flight of before, and a drone that the station hears."""
    return write_flight(lasting.here, 120.0, 300.0), lasting.drone()


def in_manual() -> dict[str, int]:
    """Tasks and their clicks, as the manual's table has them."""
    rows = re.findall(r"^\| ([^|]+) \| [^|]+ \| (\d) \|$", MANUAL.read_text("utf-8"), re.M)
    return {task.strip(): int(clicks) for task, clicks in rows}


def test_each_task_of_the_manual_takes_the_clicks_it_says_and_at_most_three(
    scene: Scene,
) -> None:
    here = scene.here
    flights = [write_flight(here, 120.0, 300.0), write_flight(here, 150.0, 300.0)]
    drone = scene.drone()
    tags, makers = scene.directory / "TagInfo.db", scene.directory / "TagManufacturer.db"
    tags.write_text("1, 4, otter, 1, 148.7\n0, 6, stoat, 1, 148.72\n", encoding="utf-8")
    makers.write_text("1, Two, 1333, 2000, Moving, Resting, 15, 60, 20\n", encoding="utf-8")
    write_map(scene.directory / "valley.mbtiles")
    watched = scene.watch()
    page, hand = watched.page, Hand(watched.page)
    took: dict[str, int] = {}

    page.click("#tab-setup")
    hand.click("#tag-add")
    type_row(page, frequency_mhz=148.71, interval_ms=1254, pulse_width_ms=20)
    second = page.locator('input[data-row="0"][data-key="second_interval_ms"]')
    assert second.input_value() == "", "nothing is assumed of a first tag"
    hand.click("#tag-save")
    expect(page.locator("#tag-state")).to_have_text("saved")
    took["enter a tag"] = hand.took()
    hand.give("#tag-import", tags, makers)
    watched.toasted("not ticked for this flight: 6")
    hand.click("#tag-save")
    expect(page.locator("#tag-state")).to_have_text("saved")
    assert page.locator(".fly-tag").evaluate_all("all => all.map(one => one.checked)") == [
        True,
        False,
    ]
    took["import tags"] = hand.took()
    hand.choose("#set-antenna", "H")
    page.wait_for_function("() => window.uavrt?.store.settings.antenna === 'H'")
    took["change the antenna"] = hand.took()

    page.click("#tab-fly")
    hand.click("#act-send_tags")
    expect(page.locator("#act-send_tags")).to_contain_text("Tags sent")
    hand.click("#act-start")
    expect(page.locator("#chip-state")).to_have_text("Detecting")
    expect(page.locator("#chip-computer")).to_have_text(re.compile(r"^5[12]\s°C$"))
    expect(page.locator("#chip-computer")).to_be_in_viewport(ratio=1.0)
    took["send the tags and start"] = hand.took()
    assert drone.tags == 1
    hand.click(".layers summary")
    hand.give("#map-import", scene.directory / "valley.mbtiles")
    expect(page.locator("#basemap")).to_have_value("valley.mbtiles")
    took["load a map"] = hand.took()
    page.click(".layers summary")

    # In the middle of it a past flight is opened: what runs can be stopped all the same.
    page.click("#tab-flights")
    hand.click(f'tr[data-flight="{flights[0]}"] .open-flight')
    expect(page.locator("#banner")).to_contain_text("Past flight")
    took["open a past flight"] = hand.took()
    hand.click("#replay-play")
    expect(page.locator("#replay-play")).to_have_text("Pause")
    took["replay it"] = hand.took()
    page.click("#replay-play")
    page.evaluate("() => window.uavrt.store.seek(Infinity)")
    # Nearer than the take-off, though another antenna has been chosen than it was flown with.
    expect(page.locator("#walk-place")).to_contain_text(re.compile(r"46\.50[1-3]"))
    took["find the position"] = hand.took()
    hand.click("#act-stop")
    page.wait_for_function("() => window.uavrt?.store.state.drone.state === 'has_tags'")
    took["stop"] = hand.took()
    page.click("#tab-flights")
    for flight_id in flights:
        hand.click(f'tr[data-flight="{flight_id}"] .tick')
    hand.click("#flights-compare")
    expect(page.locator(".compared tbody tr")).to_have_count(1)
    took["compare two flights"] = hand.took()
    with page.context.expect_page() as opened:
        hand.click(f'tr[data-flight="{flights[0]}"] .report')
    expect(opened.value.locator("body")).to_contain_text("lynx", timeout=4 * WAIT_MS)
    opened.value.close()
    took["report"] = hand.took()

    assert took == {task: n for task, n in in_manual().items() if task not in MOVING}
    assert max(took.values()) <= 3
    page.reload()
    page.click("#tab-fly")
    expect(page.locator("#basemap")).to_have_value("valley.mbtiles")


def test_on_a_tablet_the_hint_is_whole_above_many_tags(scene: Scene) -> None:
    page = scene.watch().page
    few = demo_scenario(40.0)
    more = [
        replace(tag, tag_id=tag.tag_id + 10, frequency_hz=tag.frequency_hz + 50e3)
        for tag in few.tags
    ]
    type_tags(page, SimpleNamespace(tags=[*few.tags, *more]))
    page.click("#tag-save")
    expect(page.locator("#tag-state")).not_to_contain_text("not saved")
    page.click("#tab-fly")
    hint = page.locator("#act-reason")
    expect(hint).to_contain_text("check its power and the radio")
    expect(page.locator("#cards .card")).to_have_count(2 * len(few.tags))
    assert hint.evaluate("hint => hint.scrollHeight <= hint.clientHeight")
    below = page.locator(".panel .segments").bounding_box()
    box = hint.bounding_box()
    assert box is not None
    assert box["y"] + box["height"] <= some(below)["y"]


def test_on_a_tablet_everything_is_shown_and_can_be_touched(
    station: Scene, past: tuple[str, WillingDrone]
) -> None:
    flight, watched = past[0], station.watch()
    page = watched.page
    expect(page.locator("#chip-drone")).to_contain_text("40\u202fm · 90°")
    box = page.locator("#chip-drone").bounding_box()
    assert box is not None
    assert 0.0 < box["x"] < box["x"] + box["width"] < 1024.0
    open_flight(page, flight)
    page.wait_for_selector(".fix")
    page.wait_for_selector(".rose-silence, .rose-petal")
    expect(page.locator("#cards .card .fresh").first).to_have_text("detected")
    expect(page.locator("#cards .card .facts").first).not_to_contain_text("ago")
    page.click(".layers summary")
    assert page.evaluate(TARGETS) == [], "layers"
    layers, bar = (page.locator(one).bounding_box() for one in (".layers", ".replay"))
    assert layers is not None
    assert bar is not None
    assert layers["y"] + layers["height"] <= bar["y"]
    page.click(".layers summary")
    expect(page.locator("#chip-drone")).to_contain_text("40\u202fm · 90°")
    pins_are_seen(page)
    page.locator("#map canvas").first.click(position={"x": 450, "y": 380})
    tap, bar = (page.locator(one).bounding_box() for one in ("#tap", ".replay"))
    assert tap is not None
    assert tap["y"] + tap["height"] <= some(bar)["y"]
    page.click("#tap [aria-label=Close]")
    for view in ("fly", "setup", "flights", "log"):
        page.click(f"#tab-{view}")
        assert page.evaluate(TARGETS) == [], view
        watched.picture(f"tablet-{view}")


def test_without_webgl_a_plain_map_stands_in_and_stop_works(
    station: Scene, past: tuple[str, WillingDrone]
) -> None:
    (flight, drone), watched = past, station.watch()
    page = watched.page
    page.add_init_script(f"({NO_WEBGL})()")
    page.reload()
    expect(page.locator(".flat-map")).to_be_visible()
    drone.state = drone.state.DETECTING
    expect(page.locator("#chip-state")).to_have_text("Detecting")
    open_flight(page, flight)
    expect(page.locator("#walk-place")).to_contain_text("46.502")
    expect(page.locator(".flat-over .fix")).to_have_count(1)
    expect(page.locator(".flat-over .rose").first).to_be_visible()
    pins_are_seen(page)
    watched.picture("flat")
    page.keyboard.press("x")  # by chance
    page.click("#act-stop")
    page.wait_for_function("() => window.uavrt?.store.state.drone.state === 'has_tags'")


def test_a_tap_tells_the_place_measures_and_marks(
    station: Scene, past: tuple[str, WillingDrone]
) -> None:
    _, drone = past
    watched = station.watch(
        geolocation={"latitude": 46.501, "longitude": 8.0},
        permissions=["geolocation"],
    )
    page = watched.page
    page.wait_for_selector(".drone-marker")
    drone.state = drone.state.DETECTING
    expect(page.locator("#chip-state")).to_have_text("Detecting")
    page.click(".layers summary")
    page.click("#me")
    page.wait_for_selector(".me")
    page.click(".layers summary")
    page.locator("#map canvas").first.click(position={"x": 300, "y": 330})
    expect(page.locator("#tap-place")).to_have_text(re.compile(r"46\.[45]\d+, [78]\.\d+"))
    expect(page.locator("#tap-drone")).to_contain_text("from the drone")
    expect(page.locator("#tap-me")).to_contain_text("from me")
    page.click("#tap-mark")
    expect(page.locator(".mark-place")).to_contain_text("nest seen")
    page.locator("#map canvas").first.click(position={"x": 300, "y": 330})
    page.click("#tap-measure")
    page.locator("#map canvas").first.click(position={"x": 420, "y": 330})
    expect(page.locator("#tap-measured")).to_contain_text("from the first point")
    watched.picture("tap")


def test_a_receiver_tells_where_the_people_stand(scene: Scene) -> None:
    flight = write_flight(scene.here, 120.0, 300.0)
    port = free_udp_port()
    scene.start("--my-place", f"udpin://127.0.0.1:{port}")
    ended = threading.Event()
    receiver = threading.Thread(target=send_place, args=(port, ended), daemon=True)
    receiver.start()
    watched = scene.watch()
    page = watched.page
    open_flight(page, flight)
    page.wait_for_selector(".me")
    expect(page.locator("#walk-way")).to_contain_text("of me")
    page.locator("#map canvas").first.click(position={"x": 300, "y": 330})
    expect(page.locator("#tap-me")).to_contain_text("from me")
    watched.picture("my-place")
    page.click("#tab-setup")
    expect(page.locator("#set-my-place")).to_have_value(f"udpin://127.0.0.1:{port}")
    page.fill("#set-my-place", "the shelf")
    page.keyboard.press("Tab")
    expect(page.locator("#set-my-place-fault")).to_contain_text(
        "is not the address of a GPS receiver"
    )
    page.wait_for_timeout(2500)  # states of each second leave the reason, and what was typed
    expect(page.locator("#set-my-place-fault")).to_contain_text("is not the address", timeout=1)
    expect(page.locator("#set-my-place")).to_have_value("the shelf", timeout=1)
    page.fill("#set-my-place", "")
    page.keyboard.press("Tab")
    page.click("#tab-fly")
    expect(page.locator(".me")).to_have_count(0)
    expect(page.locator("#walk-way")).not_to_contain_text("of me")
    ended.set()
    receiver.join()


def send_place(port: int, ended: threading.Event) -> None:
    """A receiver of NMEA: 46.501 N, 8.002 E, four times a second."""
    sentence = b"$GPRMC,101500,A,4630.06,N,00800.12,E,0.1,0.0,010526,,*15\r\n"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        while not ended.wait(0.25):
            receiver.sendto(sentence, ("127.0.0.1", port))


def test_two_pages_one_commander_and_no_lost_tags(scene: Scene) -> None:
    first, second = scene.commanding_and_looking_on()
    expect(second.page.locator("#take-command")).to_be_visible()
    expect(first.page.locator("#take-command")).to_be_hidden()
    expect(second.page.locator("#act-reason")).to_have_text(
        "Another page is in command. Take command first"
    )
    expect(second.page.locator(".act.next")).to_have_count(0)
    expect(first.page.locator("#act-reason")).not_to_contain_text("Another page")
    for watched, mhz in ((first, 148.71), (second, 148.72)):
        watched.page.click("#tab-setup")
        watched.page.click("#tag-add")
        type_row(watched.page, frequency_mhz=mhz, interval_ms=1254, pulse_width_ms=20)
    first.page.click("#tag-save")
    expect(first.page.locator("#tag-state")).to_have_text("saved")
    expect(second.page.locator("#tag-conflict")).to_be_visible()
    second.page.click("#take-command")
    expect(second.page.locator("#take-command")).to_be_hidden()
    second.page.click("#tag-save")
    expect(second.page.locator("#tag-conflict")).to_be_visible()
    frequency = 'input[data-row="0"][data-key="frequency_mhz"]'
    expect(first.page.locator(frequency)).to_have_value("148.71")
    second.page.click("#tag-mine")
    expect(first.page.locator(frequency)).to_have_value("148.72")


def test_a_tab_made_from_the_page_that_commands_looks_on(scene: Scene) -> None:
    """The browser copies what the tab has stored, as it does for *Duplicate tab*."""
    first = scene.watch()
    first.page.wait_for_function("() => window.uavrt?.store.state?.commander")
    expect(first.page.locator("#take-command")).to_be_hidden()
    with first.page.expect_popup() as opened:
        first.page.evaluate("() => void window.open(location.href)")
    expect(opened.value.locator("#take-command")).to_be_visible()
    for page, commands in ((first.page, True), (opened.value, False)):
        page.reload()
        expect(page.locator("#take-command")).to_be_visible(visible=not commands)


def write_two_tags(directory: Path) -> None:
    """A station's table of two tags."""
    rows = "".join(
        f"[[tag]]\nid = {number}\nfrequency_mhz = {148.7 + number / 100}\n"
        "interval_ms = 1254\npulse_width_ms = 20\n"
        for number in (2, 4)
    )
    (directory / "tags.toml").write_text(rows, encoding="utf-8")


def test_what_is_typed_is_neither_passed_over_by_a_start_nor_lost_by_a_reload(
    scene: Scene,
) -> None:
    write_two_tags(scene.here)
    drone = scene.drone()
    watched = scene.watch()
    page = watched.page
    page.click("#act-send_tags")
    expect(page.locator("#act-send_tags")).to_contain_text("Tags sent")
    page.click("#tab-setup")
    interval = page.locator('input[data-row="0"][data-key="interval_ms"]')
    interval.fill("1333")
    page.click("#tab-fly")
    page.click("#act-start")
    watched.toasted("Send the tags first")
    expect(page.locator("#view-setup")).to_be_visible()
    assert drone.state == drone.state.HAS_TAGS
    assert watched.errors == []

    page.evaluate("() => location.reload()")
    while not watched.errors:
        page.wait_for_timeout(50)
    assert watched.errors == ["dialog: "], "the browser asks, and the test stays"
    watched.errors.clear()
    expect(interval).to_have_value("1333")
    page.click("#tab-fly")
    button = page.locator("#act-send_tags")
    expect(button).not_to_contain_text("Tags sent")
    held = Held(page, "**/api/tags", "PUT", answers=False)
    button.click()
    held.wait()
    page.wait_for_timeout(1500)  # states come meanwhile, of the table as it was
    expect(button).not_to_contain_text("Tags sent", timeout=1)
    held.go()
    expect(button).to_contain_text("Tags sent")
    page.click("#act-start")
    expect(page.locator("#chip-state")).to_have_text("Detecting")
    page.reload()
    expect(page.locator("#chip-state")).to_have_text("Detecting")


def test_keys_that_do_something_need_shift_which_caps_lock_is_not(
    station: Scene, past: tuple[str, WillingDrone]
) -> None:
    (flight, drone), watched = past, station.watch()
    page = watched.page
    drone.state = drone.state.DETECTING
    expect(page.locator("#chip-state")).to_have_text("Detecting")
    theme = page.locator("html").get_attribute("data-theme")
    # With Caps Lock on a browser tells "X" for a bare x, and "x" for one with Shift.
    press = """([key, shiftKey]) => document.body.dispatchEvent(
      new KeyboardEvent("keydown", { key, shiftKey, bubbles: true }))"""
    page.evaluate(press, ["X", False])
    page.evaluate(press, ["D", False])
    assert page.locator("html").get_attribute("data-theme") != theme
    page.wait_for_timeout(1000)
    assert drone.state == drone.state.DETECTING
    page.evaluate(press, ["x", True])
    expect(page.locator("#chip-state")).to_have_text("Ready")

    # What cannot be done is said: a mark in the past, and copying where browsers forbid it.
    page.click("#tab-flights")
    held = Held(page, f"**/api/flights/{flight}", answers=False)
    page.click(f'tr[data-flight="{flight}"] .open-flight')
    held.wait()
    # A flight that begins while another is opened does not keep that from being shown.
    drone.state = drone.state.DETECTING
    expect(page.locator("#chip-state")).to_have_text("Detecting")
    page.wait_for_timeout(1000)
    held.go()
    page.wait_for_selector(".fix")
    page.locator("#map canvas").first.click(position={"x": 450, "y": 380})
    page.click("#tap-mark")
    watched.toasted("A past flight is shown")
    page.evaluate("() => Object.defineProperty(navigator, 'clipboard', { value: undefined })")
    page.click("#walk-copy")
    watched.toasted("does not allow copying")


def test_tags_are_left_out_one_after_the_other_and_every_page_shows_it(scene: Scene) -> None:
    write_two_tags(scene.here)
    first, second = scene.commanding_and_looking_on()
    for watched in (first, second):
        watched.page.click("#tab-setup")
    held = Held(first.page, "**/api/settings", "PUT", answers=False)
    boxes = first.page.locator(".fly-tag")
    boxes.nth(0).uncheck()
    boxes.nth(1).uncheck()
    for _ in range(2):  # answers that come late
        held.wait()
        first.page.wait_for_timeout(300)
        held.go()
    seen = "all => all.map((one) => one.checked)"
    for watched in (first, second):
        watched.page.wait_for_function(
            "() => window.uavrt?.store.settings.left_out.join() === '2,4'"
        )
        watched.page.wait_for_timeout(200)
        for place in (0, 1):
            expect(watched.page.locator(".fly-tag").nth(place)).not_to_be_checked()
    # A page that looks on changes nothing, and does not look as if it had.
    second.page.locator(".fly-tag").nth(0).click()
    second.toasted("Take command first")
    assert second.page.locator(".fly-tag").evaluate_all(seen) == [False, False]


@pytest.mark.parametrize("language", ["en", "de"])
def test_the_header_of_a_second_screen_with_two_vehicles_can_be_read(
    scene: Scene, language: str
) -> None:
    scene.start("--vehicle", "2")
    for number in (1, 2):
        scene.drone(system_id=number).state = SystemState.DETECTING
    _, second = scene.commanding_and_looking_on(locale=language)
    page = second.page
    expect(page.locator("#take-command")).to_be_visible()
    expect(page.locator(".chip.vehicle")).to_have_count(2)
    expect(page.locator("#chip-drone")).to_contain_text("40\u202fm")
    page.wait_for_timeout(1200)
    second.picture(f"onlooker-{language}")
    assert page.evaluate(OVERLAPS) == []
