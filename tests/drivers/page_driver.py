"""Drive the ground station's page in Debian's Chromium, for tests, screenshots and the video.

With the environment variable UAVRT_SCREENSHOTS set to a directory, `Watched.picture` saves what
is seen there (``make screenshots``).
"""

import contextlib
import io
import os
import shutil
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from command_line import launched
from film import Film
from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright
from sql import write_mbtiles
from willing_drone import WillingDrone

from uavrt.simulation.demo.demo_programs import free_udp_port

BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser")
CHROMIUM = next(filter(None, map(shutil.which, BROWSERS)), None)
"""The shell without windows takes less than half of the processor time for each page."""
ARGUMENTS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
AXE = Path(__file__).parents[2] / "page/node_modules/axe-core/axe.min.js"
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]
RUN_AXE = """(tags) => axe.run(document, { runOnly: tags }).then((found) =>
  found.violations.map((one) =>
    [one.impact, one.id, one.nodes.map((node) => node.target.join(" ")).join(", ")]))"""
VIDEO = os.environ.get("UAVRT_VIDEO")
SCREENSHOTS = os.environ.get("UAVRT_SCREENSHOTS")
KEEP_TOASTS = """() => {
  window.toasts = [];
  const take = (changes) => changes.forEach((change) => change.addedNodes.forEach((one) => {
    if (one.matches?.(".toast")) window.toasts.push(one.textContent); }));
  new MutationObserver(take).observe(document, { childList: true, subtree: true });
}"""
TAKE_TOAST = """(text) => {
  const place = window.toasts.findIndex((one) => one.includes(text));
  return place >= 0 && window.toasts.splice(0, place + 1).length > 0;
}"""
WAIT_MS = 60_000
# Machines under load take their time; what is waited for comes at once on others.
expect.set_options(timeout=WAIT_MS)


@contextlib.contextmanager
def chromium() -> Iterator[Browser]:
    """A headless browser."""
    if CHROMIUM is None:
        raise RuntimeError("Chromium is missing: `make browser` installs it from Debian")
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(
            executable_path=CHROMIUM, headless=True, args=list(ARGUMENTS)
        )
        yield running
        running.close()


def axe_findings(page: Page) -> list[list[str]]:
    """Impact, rule and places of all that axe finds in what is shown."""
    if not page.evaluate("() => 'axe' in window"):
        page.evaluate(AXE.read_text(encoding="utf-8"))
    found: list[list[str]] = page.evaluate(RUN_AXE, RULES)
    return found


class Ground:
    """``uavrt ground`` as a user starts it."""

    def __init__(self, directory: Path, port: int = 0, *more: str) -> None:
        self._log = (directory / "ground.log").open("ab")
        self._process = launched(
            *("-m", "uavrt.cli", "ground", "--no-browser", "-o", directory / "ground"),
            *("--port", str(port), *more),
            stderr=self._log,
        )
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().split()[4]
        self.port = int(self.address.rpartition(":")[2].strip("/"))

    def kill(self) -> None:
        """End it as a power cut does."""
        self._process.kill()
        self._process.communicate()
        self._log.close()

    def stop(self) -> None:
        """End it in order; nothing where it has ended already."""
        if self._process.poll() is not None:
            return
        self._process.terminate()
        try:
            self._process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            self.kill()
        self._log.close()


class Watched:
    """A page, everything it asked for, and everything that went wrong in it.

    A light that pulses is drawn sixty times a second, which takes a core without a graphics
    processor: unless a test says otherwise, its reader wants less motion. So does the map drawn
    by WebGL: a test that does not look at its pixels or layers uses the plain map.
    """

    def __init__(
        self, browser: Browser, address: str, *, plain_map: bool = True, **context: Any
    ) -> None:
        context = {"reduced_motion": "reduce"} | context
        self._context = browser.new_context(
            viewport={"width": 1024, "height": 600}, accept_downloads=True, **context
        )
        self._context.set_default_timeout(WAIT_MS)
        self._context.add_init_script(f"({KEEP_TOASTS})()")
        if plain_map:
            self._context.add_init_script("localStorage.setItem('plain', 'yes')")
        self.page: Page = self._context.new_page()
        self.hosts: set[str] = set()
        self.errors: list[str] = []
        self.page.on("request", lambda request: self.hosts.add(_host(request.url)))
        self.page.on("websocket", lambda socket: self.hosts.add(_host(socket.url)))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("dialog", self._dialog)
        self.page.goto(address)
        self._film: Film | None = None

    def _dialog(self, dialog: Any) -> None:
        if dialog.type == "prompt":
            dialog.accept("nest seen")
        else:
            self.errors.append(f"dialog: {dialog.message}")
            dialog.dismiss()

    def toasted(self, text: str) -> None:
        """Wait for a short message, which may be gone before a busy test looks for it."""
        self.page.wait_for_function(TAKE_TOAST, arg=text)

    def film(self) -> None:
        """Begin to film, when a film is wanted: ``make video``."""
        if VIDEO:
            self._film = Film(self.page)

    def caption(self, text: str, seconds: float = 4.0) -> None:
        """Say in the film what is seen; nothing without a film."""
        if self._film is not None:
            self._film.caption(text, seconds)

    def card(self, lines: list[str], seconds: float = 6.0) -> None:
        """Show in the film what stands in a terminal; nothing without a film."""
        if self._film is not None:
            self._film.card(lines, seconds)

    @contextlib.contextmanager
    def cut(self) -> Iterator[None]:
        """Leave a long wait out of the film."""
        if self._film is not None:
            self._film.cut = True
        yield
        if self._film is not None:
            self._film.cut = False

    def save_film(self, browser: Browser) -> None:
        """Write the film, if there is one."""
        if self._film is not None and VIDEO:
            self._film.save(browser, Path(VIDEO))

    def picture(self, name: str) -> None:
        if SCREENSHOTS:
            self.caption("", 0.0)
            self.page.wait_for_timeout(600)
            clear = "(all) => all.forEach((one) => one.remove())"
            self.page.locator(".toast").evaluate_all(clear)
            path = Path(SCREENSHOTS) / f"ground-{name}.png"
            self.page.screenshot(path=path)
            few = Image.open(path).convert("RGB").quantize(128, Image.Quantize.FASTOCTREE)
            few.save(path, optimize=True)  # a third of the size

    def close(self) -> None:
        self._context.close()


class Scene:
    """A ground station in a directory, pages that show it, and drones that it commands."""

    def __init__(self, directory: Path, browser: Browser) -> None:
        self.directory, self.here = directory, directory / "ground"
        """Of the test, and of the station."""
        self.here.mkdir()
        self.link_port = free_udp_port()
        """Where the station hears drones; 0 leaves that to what is typed into its page."""
        self._browser = browser
        self._grounds: list[Ground] = []
        self._pages: list[Watched] = []
        self._drones: list[WillingDrone] = []

    def start(self, *more: str, port: int = 0) -> Ground:
        """Start the station with further arguments."""
        address = f"udpin://127.0.0.1:{self.link_port}"
        link = ("--mavlink", address) if self.link_port else ()
        self._grounds.append(Ground(self.directory, port, *link, *more))
        return self._grounds[-1]

    @property
    def ground(self) -> Ground:
        """The station; started where none was."""
        return self._grounds[-1] if self._grounds else self.start()

    def drone(
        self, system_id: int = 1, *, port: int | None = None, **world: Any
    ) -> WillingDrone:
        """Start a drone that the station hears, or one at another port."""
        assert self.ground
        self._drones.append(WillingDrone(port or self.link_port, system_id, **world))
        return self._drones[-1]

    def watch(self, address: str = "", **context: Any) -> Watched:
        """Open the page, in light colours unless others are asked for."""
        context = {"color_scheme": "light"} | context
        self._pages.append(Watched(self._browser, address or self.ground.address, **context))
        return self._pages[-1]

    def commanding_and_looking_on(self, **context: Any) -> tuple[Watched, Watched]:
        """Open the page twice; the first one commands."""
        first = self.watch(**context)
        first.page.wait_for_function("() => window.uavrt?.store.state?.commander")
        return first, self.watch(**context)

    def close_pages(self) -> None:
        """Close all pages, of which none may have had an error."""
        errors = [page.errors for page in self._pages if page.errors]
        for page in self._pages:
            page.close()
        self._pages.clear()
        assert errors == []

    def close(self) -> None:
        """End the stations and drones, too."""
        try:
            self.close_pages()
        finally:
            for ground in self._grounds:
                ground.stop()
            for drone in self._drones:
                drone.close()


def open_flight(page: Page, flight_id: str) -> None:
    """Open a past flight from the list."""
    page.click("#tab-flights")
    page.click(f'tr[data-flight="{flight_id}"] .open-flight')


def _host(url: str) -> str:
    parts = urlsplit(url)
    return parts.netloc if parts.scheme in ("http", "https", "ws", "wss") else parts.scheme


def type_row(page: Page, row: int = 0, **values: object) -> None:
    """Type numbers and texts into a row of the table of tags, by the names of its fields."""
    for key, value in values.items():
        page.fill(f'input[data-row="{row}"][data-key="{key}"]', str(value))


def type_tags(page: Page, scenario: Any) -> None:
    """Type the tags in as a person does, with one mistake on the way."""
    page.click("#tab-setup")
    for place, tag in enumerate(scenario.tags):
        page.click("#tag-add")
        row = {
            "id": tag.tag_id,
            "name": tag.name or "",
            "frequency_mhz": tag.frequency_hz / 1e6,
            "interval_ms": round(tag.pulse_intervals_s[0] * 1000),
            "second_interval_ms": (
                round(tag.pulse_intervals_s[1] * 1000) if len(tag.pulse_intervals_s) > 1 else ""
            ),
            "pulse_width_ms": round(tag.pulse_width_s * 1000),
            "interval_uncertainty_ms": 60,
            "interval_jitter_ms": 20,
        }
        if tag.coded:
            page.select_option(f'select[data-row="{place}"][data-key="kind"]', "coded")
            row = {key: row[key] for key in ("id", "name", "frequency_mhz", "interval_ms")}
            row["gaps_ms"] = " ".join(f"{1e3 * gap_s:g}" for gap_s in tag.gaps_s)
        type_row(page, place, **row)


def write_map(path: Path) -> None:
    """Write a map of one grey tile at each place of the first zooms."""
    tile = io.BytesIO()
    Image.new("RGB", (256, 256), (200, 210, 190)).save(tile, "PNG")
    tiles = [
        (zoom, column, row, tile.getvalue())
        for zoom in range(4)
        for column in range(2**zoom)
        for row in range(2**zoom)
    ]
    write_mbtiles(path, {"format": "png", "bounds": "-180,-85,180,85"}, tiles)


def write_vector_map(path: Path) -> None:
    """Write a PMTiles file, version 3, of one vector tile at each place: nothing but water.

    Layout of the file, its directory and the tile: the specifications of PMTiles 3 and of
    Mapbox Vector Tiles 2.1.
    """
    corners = _varints(9, 0, 0, 26, 8192, 0, 0, 8192, 8191, 0, 15)  # a square of 4096 units
    feature = _field(3, 3) + _field(4, corners)
    layer = _field(15, 2) + _field(1, b"water") + _field(2, feature) + _field(5, 4096)
    tile = _field(3, layer)
    metadata = b'{"vector_layers": [{"id": "water", "fields": {}}]}'
    tiles = (4**4 - 1) // 3  # of zooms 0 to 3, all the same
    directory = _varints(1, 0, tiles, len(tile), 1)
    begin = 127
    places = [begin, len(directory), begin + len(directory), len(metadata)]
    end = begin + len(directory) + len(metadata)
    header = b"PMTiles\x03" + struct.pack("<11Q", *places, end, 0, end, len(tile), tiles, 1, 1)
    header += struct.pack("<6B", 1, 1, 1, 1, 0, 3)  # nothing compressed, vector, zooms
    header += struct.pack("<4iB2i", -1800000000, -850000000, 1800000000, 850000000, 0, 0, 0)
    path.write_bytes(header + directory + metadata + tile)


def _varints(*values: int) -> bytes:
    found = bytearray()
    for value in values:
        while value > 127:
            found.append(value & 127 | 128)
            value >>= 7
        found.append(value)
    return bytes(found)


def _field(number: int, value: int | bytes) -> bytes:
    """Write a field of a protocol buffer: a number, or bytes."""
    if isinstance(value, int):
        return _varints(number << 3, value)
    return _varints(number << 3 | 2, len(value)) + value


def colour_at(page: Page, x: int, y: int) -> tuple[int, ...]:
    """Colour of a pixel of the page, as it is seen."""
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    colour = picture.getpixel((x, y))
    assert isinstance(colour, tuple)
    return colour
