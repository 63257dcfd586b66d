"""A captioned film of a page, with nothing but the browser: ``make video``.

Chromium hands out pictures of the page as they change. Afterwards a second page encodes them
(WebCodecs, VP8), and they are written as WebM here. No other program is needed.

Not Playwright's recording, which needs its own build of ffmpeg, nor MediaRecorder, which on a
loaded machine kept 0.4 of 1.7 s. Frames keep their true times however slowly the machine
encodes.
"""

import base64
import json
import struct
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page

SIZE = (1024, 600)
BITS_PER_SECOND = 2_000_000
LONGEST_STILL_S = 4.0
"""A picture that stands longer, while nothing happens, is shown for so long."""
LAST_S = 2.0
SHORTEST_S = 0.2
"""Pictures that follow each other faster are one, the last: a pulsing light makes 60 a second,
and a loaded computer takes 50 ms and more to encode each."""
AT_ONCE = 20
"""Pictures that go to the encoder together."""

CAPTION = """
(text) => {
  let box = document.getElementById("film-caption");
  if (!box) {
    box = document.createElement("div");
    box.id = "film-caption";
    Object.assign(box.style, {
      position: "fixed", left: "50%", bottom: "66px", transform: "translateX(-50%)",
      maxWidth: "860px", padding: "11px 22px", borderRadius: "10px", zIndex: "1000",
      background: "rgb(10 22 28 / 0.9)", color: "#fff", font: "600 22px system-ui, sans-serif",
      textAlign: "center", pointerEvents: "none",
    });
    document.body.appendChild(box);
  }
  box.textContent = text;
  box.style.display = text ? "block" : "none";
}
"""
CARD = """
(text) => {
  const old = document.getElementById("film-card");
  if (old) old.remove();
  if (!text) return;
  const card = document.createElement("pre");
  card.id = "film-card";
  Object.assign(card.style, {
    position: "fixed", left: "60px", right: "60px", top: "80px", margin: "0", zIndex: "999",
    padding: "18px 24px", borderRadius: "10px", background: "#10181c", color: "#d9e2e6",
    font: "15px/1.5 monospace", whiteSpace: "pre-wrap", overflowWrap: "anywhere",
    boxShadow: "0 4px 30px rgb(0 0 0 / 0.5)",
  });
  card.textContent = text;
  document.body.appendChild(card);
}
"""
ENCODER = """
([width, height, bitrate]) => {
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d");
  window.chunks = [];
  const encoder = new VideoEncoder({
    output: (chunk) => {
      const bytes = new Uint8Array(chunk.byteLength);
      chunk.copyTo(bytes);
      let text = "";
      for (const byte of bytes) text += String.fromCharCode(byte);
      window.chunks.push([chunk.timestamp, chunk.type === "key", btoa(text)]);
    },
    error: (error) => { window.fault = String(error); },
  });
  encoder.configure({ codec: "vp8", width, height, bitrate, latencyMode: "realtime" });
  window.encode = async (jpeg, timestamp, keyFrame) => {
    const image = new Image();
    image.src = "data:image/jpeg;base64," + jpeg;
    await image.decode();
    context.drawImage(image, 0, 0, width, height);
    const frame = new VideoFrame(canvas, { timestamp });
    encoder.encode(frame, { keyFrame });
    frame.close();
    if (encoder.encodeQueueSize > 4) await encoder.flush();
    return window.chunks.splice(0);
  };
  window.encodeAll = async (pictures) => {
    const chunks = [];
    for (const one of pictures) chunks.push(...(await window.encode(...one)));
    return chunks;
  };
  window.finish = async () => {
    await encoder.flush();
    return window.chunks.splice(0);
  };
}
"""


class Film:
    """Pictures of a page from now on.

    `page`: what is filmed.
    """

    def __init__(self, page: Page) -> None:
        self._page = page
        self._frames: list[tuple[float, str]] = []
        self.cut = False
        """Whether what happens is left out: it becomes one still picture."""
        self._session = page.context.new_cdp_session(page)
        self._session.on("Page.screencastFrame", self._take)
        self._session.send(
            "Page.startScreencast",
            {"format": "jpeg", "quality": 75, "maxWidth": SIZE[0], "maxHeight": SIZE[1]},
        )

    def caption(self, text: str, seconds: float) -> None:
        """Show a caption and leave time to read it."""
        self._page.evaluate(CAPTION, text)
        self._page.wait_for_timeout(1000.0 * seconds)

    def card(self, lines: list[str], seconds: float) -> None:
        """Show what stands in a terminal."""
        self._page.evaluate(CARD, "\n".join(lines))
        self._page.wait_for_timeout(1000.0 * seconds)
        self._page.evaluate(CARD, "")

    def save(self, browser: Browser, path: Path) -> None:
        """End the film and write it."""
        self._session.send("Page.stopScreencast")
        encoder = browser.new_page()
        # Browsers encode only for pages of this computer or of https.
        encoder.route("**/*", lambda route: route.fulfill(body="<body>"))
        encoder.goto("http://127.0.0.1:9/")
        encoder.evaluate(ENCODER, [*SIZE, BITS_PER_SECOND])
        chunks: list[tuple[int, bool, str]] = []
        pictures = self._timed()
        for place in range(0, len(pictures), AT_ONCE):
            part = pictures[place : place + AT_ONCE]
            chunks += encoder.evaluate("(all) => window.encodeAll(all)", part)
        chunks += encoder.evaluate("() => window.finish()")
        encoder.close()
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(webm([(us, key, base64.b64decode(data)) for us, key, data in chunks]))

    def _timed(self) -> list[tuple[str, int, bool]]:
        """Pictures, their times in the film [µs], and whether they are key frames."""
        found: list[tuple[str, int, bool]] = []
        at_us, last_key_us = 0, -(10**9)
        for place, (at_s, picture) in enumerate(self._frames):
            key = at_us - last_key_us > 5_000_000
            last_key_us = at_us if key else last_key_us
            found.append((picture, at_us, key))
            if place + 1 < len(self._frames):
                still_s = min(LONGEST_STILL_S, self._frames[place + 1][0] - at_s)
                at_us += max(1000, round(1e6 * still_s))
        # Once more at the end: a player shows no picture longer than to the next one.
        found.append((self._frames[-1][1], at_us + round(1e6 * LAST_S), False))
        return found

    def _take(self, event: dict[str, Any]) -> None:
        at_s, picture = float(event["metadata"]["timestamp"]), str(event["data"])
        if self._frames and self.cut:
            self._session.send("Page.screencastFrameAck", {"sessionId": event["sessionId"]})
            return
        if self._frames and at_s - self._frames[-1][0] < SHORTEST_S:
            at_s = self._frames.pop()[0]
        self._frames.append((at_s, picture))
        self._session.send("Page.screencastFrameAck", {"sessionId": event["sessionId"]})


def log_lines(path: Path, most: int = 9) -> list[str]:
    """First lines of a program's log, for people."""
    found = []
    for line in path.read_text().splitlines()[:most]:
        record = json.loads(line)
        head = (
            f"{record.pop('timestamp')[11:19]} {record.pop('process')}: {record.pop('event')}"
        )
        record.pop("level", None)
        found.append(" ".join([head, *(f"{key}={value}" for key, value in record.items())]))
    return found


def file_tree(directory: Path) -> list[str]:
    """Files below a directory, with their sizes."""
    paths = sorted(one for one in directory.rglob("*") if one.is_file())
    return [f"{one.stat().st_size:>9,}  {one.relative_to(directory.parent)}" for one in paths]


def webm(chunks: list[tuple[int, bool, bytes]]) -> bytes:
    """Write VP8 frames (time in µs, whether a key frame, data) as WebM (RFC 9559)."""
    head = _element(
        0x1A45DFA3,
        _element(0x4282, b"webm") + _element(0x4287, b"\x04") + _element(0x4285, b"\x02"),
    )
    info = _element(
        0x1549A966,
        _element(0x2AD7B1, (1_000_000).to_bytes(3, "big"))  # times in ms
        + _element(0x4489, struct.pack(">d", chunks[-1][0] / 1000.0))
        + _element(0x4D80, b"uavrt")
        + _element(0x5741, b"uavrt"),
    )
    picture = _element(0xB0, SIZE[0].to_bytes(2, "big"))
    picture += _element(0xBA, SIZE[1].to_bytes(2, "big"))
    track = _element(0xD7, b"\x01") + _element(0x73C5, b"\x01") + _element(0x83, b"\x01")
    track += _element(0x86, b"V_VP8") + _element(0xE0, picture)
    body = info + _element(0x1654AE6B, _element(0xAE, track))
    cluster, begin_ms = b"", 0
    for time_us, key, data in chunks:
        time_ms = time_us // 1000
        if key and cluster:
            body += _element(0x1F43B675, cluster)
            cluster = b""
        if not cluster:
            begin_ms = time_ms
            cluster = _element(0xE7, begin_ms.to_bytes(4, "big"))
        block = b"\x81" + struct.pack(">hB", time_ms - begin_ms, 0x80 if key else 0) + data
        cluster += _element(0xA3, block)
    body += _element(0x1F43B675, cluster)
    return head + _element(0x18538067, body)


def _element(number: int, content: bytes) -> bytes:
    name = number.to_bytes((number.bit_length() + 7) // 8, "big")
    return name + (len(content) | 1 << 56).to_bytes(8, "big") + content
