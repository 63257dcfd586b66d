"""The ground station's page with a flight of two hours, 20 tags, 100 000 pulses.

Bars: open in under 2 s; pan for 5 s at 1024×600 in headless Chromium with a median frame
interval of 33 ms at most; a new pulse on the screen under 300 ms after it reached the socket;
under 1 MB gzipped; server under 120 MB.
"""

import gzip
import math
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

import uavrt.ground
from benchmarks.harness import Table
from uavrt.core.clock import Clock
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Pose, Pulse, PulsePose, Tag
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.link.tunnel.generations.wire import PAYLOAD_TYPE
from uavrt.link.tunnel.tunnel_records import pulse_to_wire
from uavrt.simulation.demo.demo_programs import free_udp_port

PULSES, TAGS, FLIGHT_S = 100_000, 20, 7200.0
PLANE = TangentPlane(latitude_deg=46.5, longitude_deg=8.0)

PAN = """
async () => {
  const map = window.uavrt.map();
  const times = [];
  let last = performance.now();
  const end = last + 5000;
  await new Promise((done) => {
    const frame = (now) => {
      times.push(now - last);
      last = now;
      const angle = (end - now) / 500;
      map.panBy([6 * Math.cos(angle), 6 * Math.sin(angle)], { duration: 0 });
      if (now < end) requestAnimationFrame(frame);
      else done();
    };
    requestAnimationFrame(frame);
  });
  return times.slice(1);
}
"""
RENDERER = """
() => {
  const gl = document.createElement("canvas").getContext("webgl2");
  const facts = gl.getExtension("WEBGL_debug_renderer_info");
  return gl.getParameter(facts ? facts.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
}
"""
OPEN = """
async (id) => {
  const button = document.querySelector(`tr[data-flight="${id}"] .open-flight`);
  const begun = performance.now();
  button.click();
  const map = window.uavrt.map();
  const there = () => window.uavrt.store.pulses.count >= 100000 &&
    map.querySourceFeatures("bulk").length > 0 && map.loaded();
  while (!there()) await new Promise(requestAnimationFrame);
  await new Promise(requestAnimationFrame);
  return performance.now() - begun;
}
"""


def pose_at(seconds: float) -> Pose:
    """A drone that mows 3 km of lawn and turns on its way."""
    lane, along = divmod(seconds, 300.0)
    along = along if lane % 2 == 0 else 300.0 - along
    latitude, longitude = PLANE.to_geodetic(along * 10.0, lane * 120.0)
    half = math.radians(seconds * 6.0 % 360.0) / 2.0
    return Pose(
        time_ns=1_700_000_000_000_000_000 + round(seconds * 1e9),
        latitude_deg=float(latitude),
        longitude_deg=float(longitude),
        altitude_amsl_m=1000.0,
        altitude_relative_m=60.0,
        quaternion_wxyz=(math.cos(half), 0.0, 0.0, math.sin(half)),
    )


def pulse_at(place: int, tag_id: int, pose: Pose, snr_db: float) -> PulsePose:
    """One pulse there."""
    return PulsePose(
        pulse=Pulse(
            tag_id=tag_id,
            frequency_hz=148e6 + 10_000.0 * tag_id,
            start_time_ns=pose.time_ns,
            end_time_ns=pose.time_ns + 20_000_000,
            snr_db=snr_db,
            group_snr_db=snr_db,
            score=2.0,
            group_index=1 + place % 3,
            group_sequence=place // 3,
            noise_psd=1e-9,
            detection_status="confirmed",
            confirmed=True,
            rate=1,
            predicted_next_start_ns=None,
            predicted_next_end_ns=None,
        ),
        pose=pose,
    )


def write_flight(directory: Path) -> str:
    """Record the large flight with our own recorder."""
    tags = [
        Tag(
            tag_id=2 * number + 2,
            frequency_hz=148e6 + 10_000.0 * (2 * number + 2),
            pulse_width_s=0.02,
            pulse_intervals_s=(1.4,),
        )
        for number in range(TAGS)
    ]
    keeper = FlightKeeper(directory, Clock.start())
    flight_id = keeper.begin(tags)
    rng = np.random.default_rng(1)
    for place in range(PULSES):
        seconds = FLIGHT_S * place / PULSES
        pose = pose_at(seconds)
        keeper.add_pose(pose)
        snr_db = float(12.0 + 14.0 * rng.random() + 6.0 * math.sin(seconds / 90.0))
        if place % 5000 == 0:
            keeper.queue.commit()
        keeper.add_pulse(pulse_at(place, 2 + 2 * (place % TAGS), pose, snr_db))
    keeper.close()
    return flight_id


def run() -> list[Table]:
    """Measure."""
    with tempfile.TemporaryDirectory() as work:
        flight_id = write_flight(Path(work))
        port = free_udp_port()
        server = subprocess.Popen(
            [
                *(sys.executable, "-m", "uavrt.cli", "ground", "--no-browser", "-o", work),
                *("--port", "0", "--mavlink", f"udpin://127.0.0.1:{port}"),
            ],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert server.stdout is not None
        address = server.stdout.readline().split()[4]
        try:
            rows = in_browser(address, flight_id, port)
            rows.append(["server, PSS", f"{pss_mb(server.pid):.0f} MB", "120 MB"])
        finally:
            server.terminate()
            server.communicate(timeout=20)
    rows.append(["page, gzipped", f"{page_kb():.0f} kB", "1000 kB"])
    return [
        Table(
            title=f"Page: {PULSES:,} pulses of {TAGS} tags over two hours, 1024×600",
            header=["what", "measured", "bar"],
            rows=rows,
        )
    ]


def in_browser(address: str, flight_id: str, port: int) -> list[list[str]]:
    """What the browser feels."""
    arguments = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
    arguments += ["--disable-background-networking", "--disable-sync"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), headless=True, args=arguments
        )
        page = browser.new_page(viewport={"width": 1024, "height": 600})
        page.goto(address)
        page.wait_for_function("() => window.uavrt.map().loaded()")
        page.click("#tab-flights")
        page.wait_for_selector(f'tr[data-flight="{flight_id}"]')
        open_ms = float(page.evaluate(OPEN, flight_id))
        page.wait_for_timeout(3000)
        frames: list[float] = page.evaluate(PAN)
        renderer = str(page.evaluate(RENDERER))
        page.click("#replay-live")
        page.wait_for_timeout(1000)
        latency = latency_ms(page, port)
        browser.close()
    renderer = re.sub(r"\s+", " ", renderer)[:60]
    return [
        ["open, until drawn", f"{open_ms / 1000:.2f} s", "2 s"],
        ["pan, median frame", f"{statistics.median(frames):.1f} ms", "33 ms"],
        ["pan, 95 % of frames", f"{float(np.percentile(frames, 95)):.1f} ms", ""],
        ["renderer", renderer, ""],
        ["pulse, socket to screen, worst of 20", f"{max(latency):.0f} ms", "300 ms"],
    ]


def latency_ms(page: Page, port: int) -> list[float]:
    """From the datagram's sending to the frame that draws the pulse."""
    import socket

    writer = FrameWriter(1, 191)
    heartbeat = dialect.Heartbeat(type=18, autopilot=8, system_status=4, mavlink_version=3)
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", port))
        sock.send(writer.encode(heartbeat))
        time.sleep(1.5)
        for place in range(20):
            now_ns = time.time_ns()
            pose = pose_at(place * 10.0)
            item = pulse_at(place, 2, pose, 20.0)
            payload = pulse_to_wire(_at(item, now_ns)).encode()
            message = dialect.Tunnel(
                target_system=255,
                target_component=190,
                payload_type=PAYLOAD_TYPE,
                payload_length=len(payload),
                payload=payload,
            )
            count = page.evaluate("() => window.uavrt.store.pulses.count")
            drawn = page.evaluate_handle(
                """(count) => ({ at: new Promise((done) => {
                  const look = () => window.uavrt.store.pulses.count > count
                    ? requestAnimationFrame(() => done(Date.now())) : setTimeout(look, 2);
                  look();
                }) })""",
                count,
            )
            sent_ms = time.time() * 1000.0
            sock.send(writer.encode(message))
            at_ms = float(drawn.evaluate("(holder) => holder.at"))
            found.append(at_ms - sent_ms)
            time.sleep(0.2)
    return found


def _at(item: PulsePose, now_ns: int) -> PulsePose:
    from dataclasses import replace

    start_ns = now_ns - 500_000_000
    pulse = replace(item.pulse, start_time_ns=start_ns, end_time_ns=start_ns + 20_000_000)
    return PulsePose(pulse=pulse, pose=item.pose)


def pss_mb(pid: int) -> float:
    """Proportional memory of a process [MB]."""
    text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    return int(re.search(r"^Pss:\s+(\d+)", text, re.MULTILINE)[1]) / 1024.0  # type: ignore[index]


def page_kb() -> float:
    """Size of all that a browser loads [kB], gzipped."""
    static = Path(uavrt.ground.__file__).parent / "static"
    files = [path for path in static.rglob("*") if path.is_file()]
    return sum(len(gzip.compress(path.read_bytes(), 6)) for path in files) / 1000.0
