"""A fuzzer that knows each format which a command or the page reads.

Each format has an honest file, attacks that are written for it (nesting, endless views, bombs,
sizes that cannot be, huge numbers, cells and names), and mutations of all of these. Every file
is read by the functions that commands and page use, in a process of its own. It must be read or
refused with one sentence (a list of faults with one line each), within 2 s of CPU and 200 MB.

The tests run a short form. The whole campaign::

    .venv/bin/python tests/drivers/foreign_files.py --files 2400 --seed 1
"""

import argparse
import atexit
import contextlib
import functools
import gzip
import importlib
import io
import json
import os
import random
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sql import sql

from uavrt.core.errors import UavrtError
from uavrt.core.foreign import CPU_S, MEMORY_BYTES, MOST_FAULTS

PROGRAM_BYTES = 70_000_000
"""Memory of a command before it reads its file; the fuzzer's own is larger."""
Content = bytes | Callable[[Path], None]
"""What a file holds, or what makes it where it is to be."""
Attacks = dict[str, Content]


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A foreign format."""

    name: str
    """Of the file."""
    honest: Content
    attacks: Mapping[str, Content]
    read: Callable[[Path], object]
    is_read: bool = True
    """Whether the honest file is read; an update needs a key that no test has."""
    mb_s: float = 0.0
    """CPU that a MB may take besides [s]: a recording is searched, however long it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of reading one file."""

    what: str
    """``"read"``, ``"refused"``, or what is wrong."""
    text: str
    cpu_s: float
    peak_bytes: int

    def fault(self, most_s: float = CPU_S) -> str | None:
        """Why it is not as it should be."""
        if self.what not in ("read", "refused"):
            return f"{self.what}: {self.text}"
        lines = self.text.splitlines()
        if len(lines) > MOST_FAULTS + 3 or len(self.text) > 40_000:
            return f"an error of {len(lines)} lines and {len(self.text)} characters"
        if self.cpu_s > most_s:
            return f"{self.cpu_s:.1f} s of CPU"
        if self.peak_bytes > MEMORY_BYTES:
            return f"{self.peak_bytes / 1e6:.0f} MB"
        return None


# ------------------------------------------------------------------- making files


def sqlite(*statements: str) -> Content:
    def make(path: Path) -> None:
        path.unlink(missing_ok=True)
        sql(path, *statements)

    return make


def zipped(name: str, content: bytes, kind: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", kind) as archive:
        archive.writestr(name, content)
    return stream.getvalue()


def sparse(head: bytes, size: int) -> Content:
    def make(path: Path) -> None:
        with path.open("wb") as file:
            file.write(head)
            file.truncate(size)

    return make


def late(make: Callable[[], bytes]) -> Content:
    """Content that is packed only when its file is written."""

    def write(path: Path) -> None:
        path.write_bytes(make())

    return write


def pipe(path: Path) -> None:
    os.mkfifo(path)


COMMON: Attacks = {
    "empty": b"",
    "NULs": bytes(70_000),
    "text of one letter": b"a" * 900_000,
    "ends of lines": b"\n" * 2_000_000,
    "brackets": b"[" * 100_000,
    "braces": b'{"a":' * 50_000,
    "tags of XML": b"<a>" * 200_000,
    "commas": b"," * 900_000,
    "random": random.Random(1).randbytes(50_000),
    "quotes": b'"' * 300_001,
    "3 GB": sparse(b"", 3_000_000_000),
    "pipe": pipe,
    "gzip bomb": late(lambda: gzip.compress(bytes(60_000_000))),
    "gzip of lines": late(lambda: gzip.compress(b"\n" * 30_000_000)),
    "UTF-16": "\ufeff[a]\n".encode("utf-16") * 10_000,
    "wide numbers": b"1" * 500_000 + b"\n" + b"9e999," * 1000,
    "escapes": b"\x1b[2J\x1b]0;title\x07,=1+1,@SUM(1)\n" * 1000,
}


def toml_attacks(head: str, key: str) -> Attacks:
    texts = {
        "dotted key": ".".join("a" * 20_000) + " = 1\n",
        "dotted heading": "[" + ".".join("a" * 20_000) + "]\n",
        "dotted in a table": "x = {" + ".".join("a" * 20_000) + " = 1}\n",
        "quoted parts": ".".join(['"a"'] * 15_000) + " = 1\n",
        "nested lists": "x = " + "[" * 900 + "]" * 900 + "\n",
        "nested tables": "x = " + "{a=" * 900 + "1" + "}" * 900 + "\n",
        "many keys": "".join(f"k{n} = 1\n" for n in range(15_000)),
        "misspelt keys": head + "".join(f"{key}{n} = 1\n" for n in range(4_000)),
        "many tables": "".join(f"[t{n}]\na=1\n" for n in range(12_000)),
        "lists of tables": f"{head}{key} = 1\n" * 20_000,
        "wide line": "x = [\n[" + " " * 180_000 + "1]\n]\n",
        "wide list": "x = [" + "1," * 90_000 + "]\n",
        "whole number": f"{key} = " + "9" * 100_000 + "\n",
        "dates": "".join(f"d{n} = 2026-05-01T00:00:00Z\n" for n in range(6_000)),
        "long text": f'{key} = "' + "x" * 150_000 + '"\n',
        "escapes in text": f'{key} = "' + "\\u001b" * 20_000 + '"\n',
        "not closed": '"""' + '"' * 100_000,
    }
    return {name: text.encode() for name, text in texts.items()}


TAG = (
    '[[tag]]\nid = {0}\nname = "Luna"\nfrequency_mhz = 148.7{0:02d}\ninterval_ms = 1200\n'
    "pulse_width_ms = 15\n"
)
CODED = (
    '[[tag]]\nid = {0}\nkind = "coded"\nfrequency_mhz = 166.38\nburst_interval_s = 5.3\n'
    "gaps_ms = [22.1, 48.8, {1}]\n"
)


def corners(count: int) -> list[list[float]]:
    """A ring with that many corners, in and out by turns."""
    ring = [[8.0 + 1e-3 * (n % 2), 47.0 + 1e-5 * n] for n in range(count)]
    return [*ring, [7.9, 47.0], ring[0]]


def geojson(ring: object) -> bytes:
    return json.dumps({"type": "Polygon", "coordinates": [ring]}).encode()


def kml(inside: str) -> bytes:
    head = '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
    return f"{head}{inside}</Document></kml>".encode()


def placemark(count: int, name: str = "area") -> str:
    told = " ".join(f"{east},{north},0" for east, north in corners(count))
    return (
        f"<Placemark><name>{name}</name><Polygon><outerBoundaryIs><LinearRing><coordinates>"
        f"{told}</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>"
    )


def nested(outer: str, inner: str, depth: int) -> str:
    return f"<{outer}>" * depth + inner + f"</{outer}>" * depth


def plan(polygon: object, **more: object) -> bytes:
    item = {"polygon": polygon, "type": "ComplexItem"}
    return json.dumps({"fileType": "Plan", "mission": {"items": [item]}, **more}).encode()


SHAPE_ATTACKS: Attacks = {
    "3000 corners": geojson(corners(3000)),
    "30000 corners": geojson(corners(30_000)),
    "plan of 3000 corners": plan([[north, east] for east, north in corners(3000)]),
    "nested placemarks": kml(nested("Placemark", placemark(5), 3000)),
    "nested polygons": kml(nested("Polygon", placemark(5), 3000)),
    "nested folders": kml(nested("Folder", placemark(5), 20_000)),
    "2000 placemarks": kml(placemark(5) * 2000),
    "1500 places to keep out of": kml(placemark(5, "keep out") * 1500),
    "corners of KML": kml(placemark(60_000)),
    "entities": b'<!DOCTYPE x [<!ENTITY a "aaaaaaaa">]><kml>&a;</kml>',
    "empty elements": kml("<a/>" * 300_000),
    "attributes": kml("<a " + " ".join(f'b{n}="1"' for n in range(60_000)) + "/>"),
    "collections": b'{"type":"GeometryCollection","geometries":[' * 900 + b"]}" * 900,
    "features": json.dumps(
        {"type": "FeatureCollection", "features": [{"type": "Feature"}] * 60_000}
    ).encode(),
    "empty lists": b"[" + b"[]," * 600_000 + b"[]]",
    "not finite": geojson([[float("nan"), 1e308], [float("inf"), 0], [1, 2], [3, 4]]),
    "whole numbers": b'{"type":"Polygon","coordinates":[[[1' + b"0" * 4000 + b",2]]]}",
    "escapes in a name": kml(placemark(5, "\\x1b[2J" + "n" * 100_000)),
    "circles": json.dumps(
        {
            "fileType": "Plan",
            "geoFence": {"circles": [{"circle": {"center": [47, 8], "radius": 9e4}}] * 20_000},
        }
    ).encode(),
    "thin over the earth": geojson([[-179, -89], [179, -89], [179, 89], [-179, 89]]),
}


def ulog(messages: list[tuple[bytes, bytes]], formats: list[bytes]) -> bytes:
    parts = [(b"B", bytes(40)), *((b"F", one) for one in formats), *messages]
    packed = (struct.pack("<Hc", len(body), kind) + body for kind, body in parts)
    return b"ULog\x01\x12\x35\x01" + bytes(8) + b"".join(packed)


ULOG_FORMATS = [
    b"vehicle_attitude:uint64_t timestamp;float[4] q;",
    b"vehicle_global_position:uint64_t timestamp;double lat;double lon;float alt;",
    b"sensor_gps:uint64_t timestamp;uint64_t time_utc_usec;",
]
ULOG_NAMES = [one.partition(b":")[0] for one in ULOG_FORMATS]
ADDED = [(b"A", struct.pack("<BH", 0, n) + name) for n, name in enumerate(ULOG_NAMES)]
FLOWN = [
    message
    for n in range(60)
    for message in (
        (b"D", struct.pack("<HQ4f", 0, 10**6 * n, 1, 0, 0, 0)),
        (b"D", struct.pack("<HQddf", 1, 10**6 * n, 47.0, 8.0 + 1e-5 * n, 500)),
        (b"D", struct.pack("<HQQ", 2, 10**6 * n, 1_780_000_000_000_000 + 10**6 * n)),
    )
]
ULOG = ulog([*ADDED, *FLOWN], ULOG_FORMATS)


def ulog_of_fields(text: bytes, *more: bytes) -> bytes:
    formats = [b"vehicle_attitude:uint64_t timestamp;" + text, *more]
    return ulog([ADDED[0], (b"D", struct.pack("<H", 0) + bytes(60_000))] * 3, formats)


def fmt(kind: int, name: bytes, code: bytes, columns: bytes, length: int) -> bytes:
    head = b"\xa3\x95\x80"
    return head + struct.pack("<BB4s16s64s", kind, length, name, code, columns)


def dataflash(count: int = 60) -> bytes:
    out = fmt(128, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns", 89)
    out += fmt(130, b"ATT", b"Qfff", b"TimeUS,Roll,Pitch,Yaw", 23)
    out += fmt(131, b"POS", b"QLLf", b"TimeUS,Lat,Lng,Alt", 23)
    out += fmt(132, b"GPS", b"QBIH", b"TimeUS,Status,GMS,GWk", 18)
    for n in range(count):
        time = 10**6 * n
        out += b"\xa3\x95\x82" + struct.pack("<Qfff", time, 0, 0, n)
        out += b"\xa3\x95\x83" + struct.pack("<Qiif", time, 470_000_000 + n, 80_000_000, 500)
        out += b"\xa3\x95\x84" + struct.pack("<QBIH", time, 3, 1000 * n, 2400)
    return out


def tlog(count: int = 60) -> bytes:
    from uavrt.link.mavlink import dialect
    from uavrt.link.mavlink.frame import FrameWriter

    writer = FrameWriter(1, 1)
    out = b""
    for n in range(count):
        turned = dialect.AttitudeQuaternion(
            time_boot_ms=1000 * n, q1=1.0
        )  # fmt: skip
        place = dialect.GlobalPositionInt(
            time_boot_ms=1000 * n, lat=470_000_000 + n, lon=80_000_000, alt=500_000,
            relative_alt=40_000,
        )  # fmt: skip
        for message in (turned, place):
            stamp = struct.pack(">Q", 1_780_000_000_000_000 + 10**6 * n)
            out += stamp + writer.encode(message)
    return out


def gpx(points: str) -> bytes:
    return f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>".encode()


def trkpt(n: int) -> str:
    time = f"2026-05-01T08:{n // 60 % 60:02d}:{n % 60:02d}Z"
    return f'<trkpt lat="{47 + 1e-5 * n}" lon="8"><ele>500</ele><time>{time}</time></trkpt>'


NMEA = "".join(
    f"$GPRMC,0815{n:02d}.00,A,4700.{n:04d},N,00800.0000,E,0.0,0.0,010526,,,A\n"
    f"$GPGGA,0815{n:02d}.00,4700.{n:04d},N,00800.0000,E,1,12,0.8,500.0,M,,M,,\n"
    f"$GPHDT,{n},T\n"
    for n in range(60)
).encode()


def tiff(entries: dict[int, tuple[int, int, bytes]], body: bytes = b"") -> bytes:
    """Entries are kind, count and content; content begins behind the directory."""
    at = 8 + 2 + 12 * len(entries) + 4
    directory, more = struct.pack("<H", len(entries)), body
    for tag, (kind, count, value) in sorted(entries.items()):
        if len(value) > 4:
            directory += struct.pack("<HHII", tag, kind, count, at + len(more))
            more += value
        else:
            directory += struct.pack("<HHI", tag, kind, count) + value.ljust(4, b"\0")
    return struct.pack("<2sHI", b"II", 42, 8) + directory + bytes(4) + more


def geotiff(
    side: int = 100, packed: int = 8, block: bytes | None = None, blocks: int = 1
) -> bytes:
    data = block if block is not None else zlib.compress(bytes(2 * side * side))
    at = struct.pack("<I", 8 + 2 + 12 * 13 + 4)
    entries: dict[int, tuple[int, int, bytes]] = {
        256: (4, 1, struct.pack("<I", side)),
        257: (4, 1, struct.pack("<I", side)),
        258: (3, 1, struct.pack("<H", 16)),
        259: (3, 1, struct.pack("<H", packed)),
        277: (3, 1, struct.pack("<H", 1)),
        278: (4, 1, struct.pack("<I", side)),
        339: (3, 1, struct.pack("<H", 2)),
        273: (4, blocks, at * blocks),
        279: (4, blocks, struct.pack("<I", len(data)) * blocks),
        33550: (12, 3, struct.pack("<3d", 0.01, 0.01, 0)),
        33922: (12, 6, struct.pack("<6d", 0, 0, 0, 8, 48, 0)),
        34735: (3, 12, struct.pack("<12H", 1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4326)),
        42113: (2, 6, b"-9999\0"),
    }
    return tiff(entries, data)


MBTILES = (
    "CREATE TABLE metadata (name TEXT, value TEXT)",
    "CREATE TABLE tiles (zoom_level INT, tile_column INT, tile_row INT, tile_data BLOB)",
    "INSERT INTO metadata VALUES ('format', 'png'), ('bounds', '7,46,9,48')",
    "INSERT INTO tiles VALUES (1, 1, 1, x'89504e47')",
)
ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"


def pmtiles(root: bytes, facts: bytes = b"{}", **changed: int) -> bytes:
    packed_root, packed_facts = gzip.compress(root), gzip.compress(facts)
    numbers = {
        "root": 127, "root_length": len(packed_root),
        "facts": 127 + len(packed_root), "facts_length": len(packed_facts),
        "leaves": 0, "leaves_length": 0,
        "data": 127 + len(packed_root) + len(packed_facts), "data_length": 4,
        "a": 0, "b": 0, "c": 0,
    } | changed  # fmt: skip
    header = b"PMTiles\x03" + struct.pack("<11Q", *numbers.values())
    header += struct.pack("<6B4iB2i", 1, 2, 1, 2, 1, 1, 0, 0, 10**7, 10**7, 1, 0, 0)
    return header + packed_root + packed_facts + b"tile"


SIGMF = {
    "global": {
        "core:datatype": "cf32_le", "core:sample_rate": 48_000.0, "core:version": "1.0.0",
    },
    "captures": [
        {"core:sample_start": 0, "core:frequency": 148.7e6,
         "core:datetime": "2026-05-01T08:15:00Z"}
    ],
    "annotations": [],
}  # fmt: skip


def sigmf(**changed: object) -> bytes:
    return json.dumps(SIGMF | changed).encode()


def sigmf_captures(*captures: Mapping[str, object]) -> bytes:
    return sigmf(captures=[SIGMF["captures"][0], *captures])  # type: ignore[index]


def riff(*chunks: tuple[bytes, int, bytes], size: int | None = None) -> bytes:
    body = b"WAVE" + b"".join(
        name + struct.pack("<I", told) + content for name, told, content in chunks
    )
    return b"RIFF" + struct.pack("<I", len(body) if size is None else size) + body


WAVE = struct.pack("<HHIIHH", 1, 2, 48_000, 192_000, 4, 16)

PULSE = {
    "tag_id": 2, "frequency_hz": 148.7e6, "start_time_ns": 1_780_000_000_000_000_000,
    "end_time_ns": 1_780_000_000_020_000_000, "snr_db": 20.0, "group_snr_db": 20.0,
    "score": 1.0, "group_index": 0, "group_sequence": 1, "noise_psd": 1e-12,
    "detection_status": "confirmed", "confirmed": True, "rate": 1,
    "predicted_next_start_ns": None, "predicted_next_end_ns": None, "latitude_deg": 47.0,
    "longitude_deg": 8.0, "altitude_amsl_m": 500.0, "altitude_relative_m": 40.0,
    "quaternion_wxyz": [1.0, 0.0, 0.0, 0.0],
}  # fmt: skip


def pulses(count: int = 50, **changed: object) -> bytes:
    lines = (
        json.dumps(
            PULSE
            | {"start_time_ns": 1_780_000_000_000_000_000 + 1_200_000_000 * n,
               "end_time_ns": 1_780_000_000_020_000_000 + 1_200_000_000 * n}
            | changed
        )
        for n in range(count)
    )  # fmt: skip
    return ("\n".join(lines) + "\n").encode()


ROW_2023 = (
    "7,2,148710225,1684766889.853803,1684766891.062759,36.843531,2.749993,13,1,36.563833,1,1,"
    "35.178241,-111.656588,9.693001,0.00189066,-0.00109068,0.71339,0.700764\n"
)
UCSD = (
    "Run,Timestamp,Frequency,Amplitude,Easting,Northing,Altitude,Heading,EPSG Code\n"
    "1,1700000000.0,172464000,-67.1,462300.0,5249900.0,,,32632\n"
)
GNOME = (
    "G,1700000000.0,47.0,8.0,500\nS,1700000000.1,1,-m,166.376,0,\np1,1700000001.2,4,-40,-80\n"
)
HITS = (
    "runID,hitID,ts,sig,noise,freq,slop,antBearing,id,lat,lon,alt,nomFreq\n"
    "1,1,1700000000.5,-40,-80,4,0.001,0,12,47.0,8.0,500,166.38\n"
)
SIGNALS = (
    "Device;Time;Frequency;Duration;max (dBW);avg (dBW);std (dB);noise (dBW);snr (dB)\n"
    "0;2023-01-01 00:00:00.5;150000000;0:00:00.020;-40;-42;1;-80;40\n"
)
ESTIMATES = (
    "Run,Timestamp,Frequency,Easting,Northing,Altitude,EPSG Code\n"
    "1,1700000000.0,172464000,462300.0,5249900.0,,32632\n"
)
THESIS_ROW = (
    "2, 148.71, 1700205419, 230494976, 1700205419, 250494957, 1700205420, 434494972, "
    "1700205420, 4294967295, 69.6484, 0.219541, 1, 69.8253, 1, 1, 47.3978, 8.54561, 488.077, "
    "0.00189066, -0.00109068, 0.71339, 0.700764\n"
)
ANTENNA = "".join(f"{angle},{-angle / 10}\n" for angle in range(0, 181, 15))
TELEMETRY = (
    "time_ns,latitude_deg,longitude_deg,altitude_amsl_m,altitude_relative_m,qw,qx,qy,qz\n"
    "1780000000000000000,47,8,500,40,1,0,0,0\n"
)
CODES = "id,frequency_mhz,burst_interval_s,g1,g2,g3\n"
TAGS = "name,id,frequency_mhz,interval_ms,pulse_width_ms\nLuna,2,148.712,1200,20\n"
FOLD: dict[str, Any] = {
    "tag_id": 2, "interval_s": 1.2, "length_s": 100.0, "profile": [0.0] * 40,
    "raster": [[0.0] * 40] * 10,
}  # fmt: skip
VERDICT: dict[str, Any] = {
    "tag_id": 2, "found": False, "false_alarm_probability": 0.5, "interval_s": 1.2,
    "frequency_hz": 148.7e6, "parts": [], "region50": [], "remarks": "x",
}  # fmt: skip
MAKERS = "3,Two,1333,2000,Moving,Resting,15,60,20\n"


def table(
    name: str,
    text: str,
    read: Callable[[Path], object],
    *,
    rows: int = 1,
    separator: str = ",",
    more: Attacks | None = None,
) -> Format:
    """A table: what stands above its last line, and that line, so many times."""
    *above, line = text.splitlines(keepends=True)
    head, cells = "".join(above), line.strip().split(separator)

    def changed(place: int, value: str, count: int = 1) -> bytes:
        row = separator.join([*cells[:place], value, *cells[place + 1 :]])
        return f"{row}\n".encode() * count

    damaged = {
        "wide cell": changed(1, "x" * 140_000),
        "quoted cell": changed(0, '"' + "7" * 140_000),
        "many cells": f"{line.strip()}{separator * 400_000}\n".encode(),
        "not finite": changed(len(cells) // 2, "nan") + changed(2, "1e999") * 500,
        "far times": b"".join(changed(n, "9" * 25) for n in range(len(cells))),
        "damaged lines": b"".join(changed(n % len(cells), "?") for n in range(8_000)),
        "one damaged of many": line.encode() * 3_000 + changed(2, "?"),
        "formulas": changed(1, "=HYPERLINK(1)"),
        "escapes": changed(1, "\x1b[2J"),
    }
    attacks: Attacks = {what: head.encode() + one for what, one in damaged.items()}
    attacks["packed"] = gzip.compress(head.encode() + line.encode() * 10)
    attacks["packed bomb"] = late(lambda: gzip.compress(line.encode() * 200_000))
    honest = (head + rows * line).encode()
    return Format(name=name, honest=honest, attacks=attacks | (more or {}), read=read)


def update_tar(manifest: bytes, *more: tarfile.TarInfo) -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as archive:
        for name, content in (("update.json", manifest), ("update.sig", bytes(64))):
            about = tarfile.TarInfo(name)
            about.size = len(content)
            archive.addfile(about, io.BytesIO(content))
        for one in more:
            archive.addfile(one)
    return stream.getvalue()


def flight_attacks() -> Attacks:
    def changed(*statements: str) -> Content:
        def make(path: Path) -> None:
            honest_flight(path)
            sql(path, *statements)

        return make

    return {
        "endless view": changed(
            "DROP TABLE poses", f"CREATE VIEW poses AS {ENDLESS} SELECT i, i, i, i, i, i FROM n"
        ),
        "text for numbers": changed("UPDATE pulses SET snr_db = 'loud'"),
        "NULL": changed("UPDATE flight SET start_time_ns = NULL"),
        "far times": changed(f"UPDATE pulses SET start_time_ns = {2**63 - 1} WHERE rowid = 1"),
        "negative times": changed(
            f"UPDATE pulses SET start_time_ns = {1 - 2**63} WHERE rowid = 1"
        ),
        "blob": changed("UPDATE flight SET settings = zeroblob(100000000)"),
        "settings": changed("UPDATE flight SET settings = '" + "[" * 50_000 + "'"),
        "tag lists": changed("UPDATE tags SET pulse_intervals_s = '" + "[" * 5_000 + "'"),
        "no tables": sqlite("CREATE TABLE other (a)"),
        "other columns": sqlite("CREATE TABLE flight (a)", "INSERT INTO flight VALUES (1)"),
        "generated column": changed(
            "DROP TABLE tags",
            "CREATE TABLE tags (tag_id AS (length(printf('%.*c', 90000000, 'x'))), a)",
            "INSERT INTO tags (a) VALUES (1)",
        ),
        "trigger": changed(
            "CREATE TRIGGER t AFTER INSERT ON pulses BEGIN DELETE FROM pulses; END"
        ),
        "generated notes": changed(
            "DROP TABLE notes",
            "CREATE TABLE notes (time_ns, text AS (printf('%.*c', 9000000, 'x')))",
            f"INSERT INTO notes (time_ns) {ENDLESS} SELECT i FROM n LIMIT 200",
        ),
        "long default": changed(
            f"ALTER TABLE notes ADD COLUMN more TEXT DEFAULT '{'x' * 900_000}'"
        ),
        **{name: changed(*(f"UPDATE {one}" for one in updates))
           for name, updates in FLIGHT_UPDATES.items()},
        "notes": changed(
            "INSERT INTO notes (time_ns, text) VALUES (1, x'ff'), (3, 'home 91 500'),"
            " (2, 'home 1e999 nan'), (4, 'vehicle ' || printf('%.*c', 90000, '9'))"
        ),
        "health": changed(
            "INSERT INTO health (time_ns, process, status, ok, counters) VALUES"
            " (1, 'connection', 'x', 'y', '[1]')"
        ),
        "many tags": changed(
            f"INSERT INTO tags (tag_id, name, frequency_hz) {ENDLESS} SELECT i + 9, '', 1.5e8"
            " FROM n LIMIT 20000"
        ),
    }  # fmt: skip


FLIGHT_UPDATES = {
    "zero attitudes": [
        f"{table} SET quaternion_w = 0, quaternion_x = 0, quaternion_y = 0, quaternion_z = 0"
        for table in ("poses", "pulse_poses")
    ],
    "off the globe": [f"{one} SET latitude_deg = 1e9" for one in ("poses", "pulse_poses")],
    "around the globe": [
        f"{one} SET longitude_deg = rowid * 3, latitude_deg = 0"
        for one in ("poses", "pulse_poses")
    ],
    "huge heights": ["poses SET altitude_relative_m = -1e300, altitude_amsl_m = 1e308"],
    "not finite": ["pulses SET snr_db = 9e999, noise_psd = -9e999, frequency_hz = 9e999"],
    "negative noise": ["pulses SET noise_psd = -1, snr_db = -1e300, group_snr_db = 1e300"],
    "zero frequency": ["pulses SET frequency_hz = 0", "tags SET frequency_hz = 0"],
    "zero interval": ["tags SET pulse_intervals_s = '[0, 1e-300]', k = 999999999"],
    "no interval": ["tags SET pulse_intervals_s = '5'"],
    "other tags": ["pulses SET tag_id = pulse_id * 1000003"],
    "all time": [
        "pulses SET start_time_ns = pulse_id * 100000000000000000,"
        " end_time_ns = pulse_id * 100000000000000000"
    ],
    "early end": ["pulses SET end_time_ns = -9000000000000000000"],
    "text for places": ["poses SET latitude_deg = 'north'"],
    "last second": [f"flight SET start_time_ns = {2**63 - 1}, clock_offset_ns = {-(2**63)}"],
    "list of settings": ["flight SET settings = '[1]'"],
    "odd settings": ['flight SET settings = \'{"antenna": {"yaw_offset_deg": 1e400}}\''],
    "escapes": ["tags SET name = char(27) || '[2J<script>=1+1' || printf('%.*c', 90000, 'n')"],
    "blob for a name": ["tags SET name = x'ff00ff'"],
}
"""What is set to other values in an honest flight."""


def honest_flight(path: Path) -> None:
    path.write_bytes(_flight_content())


@functools.cache
def _flight_content() -> bytes:
    from past_flight import write_flight

    with tempfile.TemporaryDirectory() as name:
        source = Path(name) / write_flight(Path(name), 100.0, 200.0) / "flight.sqlite"
        sql(source, "PRAGMA wal_checkpoint(TRUNCATE)", "PRAGMA journal_mode=DELETE")
        return source.read_bytes()


# ------------------------------------------------------------------- reading files


def reader(place: str) -> Callable[[Path], object]:
    """Import a reader only when it is used, because its memory counts."""
    module, _, name = place.rpartition(".")

    def read(path: Path) -> object:
        return getattr(importlib.import_module(module), name)(path)

    return read


read_pulses = reader("uavrt.flight.reading.recognise.read_pulse_log")
read_any_track = reader("uavrt.analysis.tracks.recognised.read_track")


def read_tag_file(path: Path) -> object:
    from uavrt.config.settings import DetectionSettings
    from uavrt.config.tags.code_rules import words_of_near_codes
    from uavrt.config.tags.tag_files import read_tags

    return words_of_near_codes(read_tags(path), DetectionSettings().frequency_window_hz)


def import_tags(path: Path) -> object:
    from uavrt.core.foreign import TAGS, read_file
    from uavrt.ground.store import tag_table

    files = {path.name: read_file(path, TAGS).decode("utf-8", "replace")}
    if path.suffix == ".db":
        files["TagManufacturer.db"] = MAKERS
    rows = tag_table.import_rows(files)
    return tag_table.tags_from_rows(rows), tag_table.not_selected(files)


def read_shape(path: Path) -> object:
    from uavrt.analysis.covered.coverage_maps import read_places
    from uavrt.config.text_files import read_text
    from uavrt.core.foreign import SHAPES
    from uavrt.ground.link.motions.area_files import area_of_file
    from uavrt.guidance.files.area_text import keep_out_in

    text = read_text(path, SHAPES)
    found: list[object] = [read_places(path, 60.0)]
    with contextlib.suppress(UavrtError):
        keep_out_in(text, path.name, every=True)
    with contextlib.suppress(UavrtError):
        found.append(area_of_file({"name": path.name, "text": text}))
    return found


def read_heights(path: Path) -> object:
    from uavrt.localization.terrain.elevation_files import open_elevation

    return open_elevation(path).heights_m([47.5, 47.51], [8.5, 8.9])


def read_map_file(path: Path) -> object:
    from uavrt.analysis.inputs.map_files import maps_in, read_map

    maps_in(path.parent)
    found = read_map(path)
    return found.credit, found.tile(1, 1, 0), found.tile(20, 5, 7)


def read_samples(path: Path) -> object:
    """Search a recording for a tag, as `uavrt detect` does."""
    from uavrt.analysis.measure.recorded_pulses import detect
    from uavrt.radio.opening import open_recording

    if path.suffix == ".sigmf-meta":
        path.with_suffix(".sigmf-data").write_bytes(bytes(8 * 4800))
    raw = path.suffix not in (".sigmf-meta", ".wav")
    rate_hz, frequency_hz = (48_000.0, 148.7e6) if raw else (None, None)
    source = open_recording(path, sample_rate_hz=rate_hz, center_frequency_hz=frequency_hz)
    with contextlib.closing(source):
        return detect(source, [recorded_tag(source.center_frequency_hz)], lambda _: None)


def recorded_tag(frequency_hz: float) -> Any:
    from uavrt.core.messages import Tag

    return Tag(
        tag_id=2, frequency_hz=frequency_hz, pulse_width_s=0.02, pulse_intervals_s=(1.254,)
    )


def read_certificate(path: Path) -> None:
    from uavrt.ground.web.server import ServerSettings, listening_socket

    for name, content in zip(("page.pem", "page.key"), certificate(), strict=True):
        if path.name != name:
            path.with_name(name).write_bytes(content)
    pem, key = path.with_name("page.pem"), path.with_name("page.key")
    listening_socket(ServerSettings(port=0, certificate=pem, key=key)).close()


def read_secret(path: Path) -> object:
    from uavrt.link.mavlink.sending.signing import read_signing_key
    from uavrt.link.tunnel.own_messages.seal import read_key

    path.chmod(0o600)
    return read_key(path), read_signing_key(path)


def start_ground(path: Path) -> object:
    """Start a ground station in whose directory one file is another."""
    from uavrt.ground.store.drone_directory import flight_under_way
    from uavrt.ground.store.event_log import EventLog
    from uavrt.ground.store.ground_settings import GroundStore
    from uavrt.ground.store.stored_flights import FlightLibrary

    store = GroundStore(path.parent)
    library = FlightLibrary(path.parent)
    library.summaries()
    lines = EventLog(store.log_path).lines()
    return store.settings, store.corrections_listed, flight_under_way(path.parent), lines


def start_drone(path: Path) -> object:
    """Start a drone side in whose directory one file is another."""
    from uavrt.config.settings import RecordingSettings, Settings
    from uavrt.core.messages import Tag
    from uavrt.drone.processes.connection_parts.signing_memory import SigningMemory
    from uavrt.drone.supervisor.mission.kept_parameters import SettingsInForce
    from uavrt.drone.supervisor.mission.saved_state import StateStore
    from uavrt.flight.kept_file import KeptFile
    from uavrt.link.mavlink.sending.signing import Signing, SigningKey

    settings = Settings(recording=RecordingSettings(directory=str(path.parent)))
    if path.name == "signing_times.json":
        SigningMemory(Signing(SigningKey(bytes(32)), lambda: 0), path.parent)
    if path.name == "last_tags.json":
        return KeptFile(path, tuple[Tag, ...], "last tags").read()
    in_force = SettingsInForce(settings, on_change=lambda _changed: None)
    return StateStore(path.parent).read(), in_force.now


def read_update_file(path: Path) -> object:
    from uavrt.drone.computer.update_file import read_update

    keys = path.with_name("keys.pem")
    keys.write_text(
        "-----BEGIN PUBLIC KEY-----\n"
        "MCowBQYDK2VwAyEAGb9ECWmEzf6FQbrBZ9w7lshQhqowtrbLDFw4rXAxZuE=\n"
        "-----END PUBLIC KEY-----\n"
    )
    keys.chmod(0o644)
    return read_update(path, keys)


def each(*calls: Callable[[], object]) -> None:
    """Call all of them; the first refusal is raised at the end."""
    refusals = []
    for call in calls:
        try:
            call()
        except UavrtError as error:
            refusals.append(error)
    if refusals:
        raise refusals[0]


def read_whole_flight(path: Path) -> None:
    """Read a flight as the page, a report's and an export's survey, and a season do."""
    from uavrt.analysis.covered.silence import silent_map
    from uavrt.analysis.inputs.flight_noise import flight_noise_of
    from uavrt.analysis.measure.bag import export_bag
    from uavrt.analysis.season import read_season
    from uavrt.flight.reading import flight_reader
    from uavrt.ground.store.estimates import AntennaChoice, Estimator
    from uavrt.ground.store.stored_flights import FlightLibrary
    from uavrt.ground.web.work.exports import EXPORTS, export

    above = path.parent
    directory = above / "flight_log_1"
    later = above / "flight_log_2"
    for place in (directory, later):
        place.mkdir()
    shutil.move(path, directory)
    honest_flight(later / path.name)
    library, antenna = FlightLibrary(above), AntennaChoice(pattern="RA-23K", offset_deg=0.0)

    def of_listed(name: str, *more: int) -> Callable[[], object]:
        return lambda: getattr(library, name)("flight_log_1", *more)

    def estimate() -> object:
        columns, tags = library.columns("flight_log_1"), library.summary("flight_log_1").tags
        past = Estimator().past(directory, antenna)
        return Estimator().estimate(columns, antenna, (), tags, (), past).record()

    library.summaries()
    library.usual_noise_db(None, but=None)
    each(
        *map(of_listed, ("summary", "places", "columns", "log")),
        of_listed("records", 0, 1000),
        *(
            functools.partial(getattr(flight_reader, f"read_{one}"), directory)
            for one in ("health", "search_notes", "search_reports", "beeps", "stops")
        ),
        estimate,
        lambda: Estimator().past(later, antenna),
        lambda: read_season(above),
        lambda: flight_noise_of(directory),
        lambda: export_bag(directory, above / "bag"),
        lambda: silent_map(
            *(directory, flight_reader.read_flight(directory), 2, -30.0),
            elevation=None,
            antenna="RA-23K",
        ),
        *(functools.partial(export, name, directory, antenna) for name in EXPORTS),
    )


def read_verdicts(path: Path) -> object:
    from uavrt.ground.web.work.flight_maps import integrated_record
    from uavrt.ground.web.work.integration_jobs import fold_pictures

    place = path.parent / "flight/integrated"
    place.mkdir(parents=True)
    shutil.move(path, place / path.name)
    return integrated_record(place.parent), fold_pictures(place.parent)


@functools.cache
def small_archive() -> Path:
    """What a batch writes of one flight; for as long as this program lives."""
    from past_flight import TAG as LYNX
    from past_flight import write_flight

    from uavrt.analysis.archive.batch_run import run_batch
    from uavrt.analysis.archive.recordings import find_recordings
    from uavrt.analysis.archive.steps.batch_settings import BatchSettings
    from uavrt.analysis.measure.tag_source import TagSource

    name = tempfile.TemporaryDirectory()
    atexit.register(name.cleanup)
    place = Path(name.name)
    write_flight(place / "flights", 100.0, 200.0)
    found = find_recordings([place / "flights"], {})
    run_batch(found, TagSource(tags=(LYNX,)), place / "archive", BatchSettings(workers=1))
    return place / "archive"


def archive_file(place: str) -> Content:
    def make(path: Path) -> None:
        shutil.copyfile(next(small_archive().glob(place)), path)

    return make


def archive_with(place: str) -> Callable[[Path], object]:
    """Have a reader ask an archive of which one file is another."""

    def read(path: Path) -> None:
        from uavrt.analysis.archive.exporting import export_archive
        from uavrt.analysis.archive.parquet.flight_search import find_flights
        from uavrt.analysis.archive.parquet.ledger import Ledger
        from uavrt.analysis.archive.parquet.parquet_tables import RecordingRow
        from uavrt.analysis.archive.parquet.questions import QUESTIONS, ask

        archive = path.with_name("archive")
        shutil.copytree(small_archive(), archive)
        replaced = next(archive.glob(place))
        replaced.unlink()
        shutil.move(path, replaced)
        each(
            lambda: find_flights(archive),
            *(functools.partial(ask, archive, one) for one in QUESTIONS.values()),
            lambda: export_archive(archive, path.with_name("exported"), None, None),
            lambda: Ledger(archive, "done", RecordingRow, ("pulses",)),
        )

    return read


DETECTOR = (
    b"ID:\t2\ntagFreqMHz:\t148.7\nchannelCenterFreqMHz:\t148.7\nFs:\t3750\ntip:\t1.2\n"
    b"tp:\t0.02\n"
)
GPX_ATTACKS: Attacks = {
    "nested": gpx("<a>" * 30_000 + "</a>" * 30_000),
    "many points": gpx("".join(map(trkpt, range(8_000)))),
    "far points": gpx(
        '<trkpt lat="1e300" lon="nan"><time>9999-12-31T23:59:59Z</time></trkpt>' * 5000
    ),
    "no times": gpx('<trkpt lat="1" lon="2"/>' * 20_000),
    "gap of years": gpx(trkpt(0) + trkpt(1).replace("2026", "0001")),
    "entities": b"<!DOCTYPE x><gpx/>",
    "packed": gzip.compress(gpx("".join(map(trkpt, range(60))))),
}  # fmt: skip


def rows_of(*numbers: float) -> bytes:
    """Raw samples as complex64."""
    return struct.pack(f"<{len(numbers)}f", *numbers)


NOISE = struct.pack("<40000f", *(random.Random(3).gauss(0, 0.01) for _ in range(40_000)))
RAW_ATTACKS: Attacks = {
    "not finite": rows_of(float("nan"), float("inf"), 1.0, -float("inf")) * 5_000,
    "huge": rows_of(3e38, -3e38) * 20_000,
    "tiny": rows_of(1e-45, -1e-40) * 20_000,
    "one of many": NOISE + rows_of(float("nan"), 1e30) + NOISE,
    "steps": (NOISE + rows_of(1e9, 1e9) * 3_000) * 3,
    "half a sample": NOISE[:-3],
    "one sample": bytes(8),
    "one byte": b"a",
    "full scale": b"\x7f\x80" * 300_000,
    "ends of a scale": b"\xff\x00\x80" * 200_000,
}
KEPT_TAG: dict[str, Any] = {
    "tag_id": 2, "frequency_hz": 148.71e6, "pulse_width_s": 0.02, "pulse_intervals_s": [1.2],
}  # fmt: skip
SAVED: dict[str, Any] = {
    "boot_id": "a", "clock_offset_ns": 1, "state": "HAS_TAGS", "tags": [KEPT_TAG],
    "flight": None, "last_flights": ["a"], "waiting": {"DET_K": 3.0}, "commander": None,
}  # fmt: skip
CORRECTION: dict[str, Any] = {
    "time_ns": 1, "tag_id": 2, "what": "frequency", "before": KEPT_TAG,
    "after": KEPT_TAG | {"frequency_hz": 148.7101e6},
}  # fmt: skip
STATION: dict[str, Any] = {
    "settings": {"antenna": "RA-23K"}, "current_flight": "../../etc", "vehicle": [1, "u"],
    "commander": "page", "further_vehicles": [2],
}  # fmt: skip
KNOWN: dict[str, Any] = {"version": 1, "flights": []}
LOG_LINE: dict[str, Any] = {"time_ns": 1, "severity": 6, "text": "Started", "source": "ground"}


def records(
    name: str,
    record: Any,
    read: Callable[[Path], object],
    more: Mapping[str, Mapping[str, Any]] | None = None,
) -> Format:
    """Records in JSON: other values in each field, also those of `more`, and odd shapes."""
    listed = isinstance(record, list)
    fields = record[0] if listed else record
    values: dict[str, Any] = {
        "nothing": None, "whole": 10**4000, "negative": -(2**70), "number": 1.5, "text": "x",
        "escapes": "\x1b[2J\0" * 9_000, "long": "x" * 5_000_000, "list": [[]] * 300_000,
        "object": {"a": {}}, "objects": [{}] * 200_000, "yes": True,
    }  # fmt: skip

    def changed(**to: Any) -> Content:
        one = fields | to
        return late(lambda: json.dumps([one] if listed else one).encode())

    whole = json.dumps(record)
    attacks: Attacks = {
        f"{what} in all": changed(**dict.fromkeys(fields, value))
        for what, value in values.items()
    } | {
        f"{what} for {field}": changed(**{field: values[what]})
        for field in fields
        for what in ("nothing", "whole", "escapes", "list")
    } | {
        f"deep {field}": json.dumps(fields | {field: 0}).replace(
            f'"{field}": 0', f'"{field}": ' + "[" * 90_000 + "]" * 90_000).encode()
        for field in fields
    } | {what: changed(**to) for what, to in (more or {}).items()} | {
        "many": late(lambda: f"[{','.join([json.dumps(fields)] * 60_000)}]".encode()),
        "deep unknown": f'{json.dumps(fields)[:-1]}, "x": {"[" * 90_000}'.encode()
        + b"]" * 90_000 + b"}",
        "lines": f"{whole}\n".encode() * 60_000,
        "list of it": f"[{whole}]".encode(),
        "bytes": whole.encode().replace(b"a", b"\xff"),
    }  # fmt: skip
    return Format(name=name, honest=whole.encode(), attacks=attacks, read=read)


@functools.cache
def certificate() -> tuple[bytes, bytes]:
    """Make a certificate and its key."""
    command = (
        "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 9 -subj"
        " /CN=a -keyout key -out pem"
    )
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        subprocess.run(command.split(), cwd=place, check=True, capture_output=True)
        return (place / "pem").read_bytes(), (place / "key").read_bytes()


def pem_attacks(number: int) -> Attacks:
    """Of the certificate (0) or its key (1)."""
    body = b"A" * 64 + b"\n"

    def made(change: Callable[[bytes], bytes]) -> Content:
        return late(lambda: change(certificate()[number]))

    return {
        "other half": late(lambda: certificate()[1 - number]),
        "many": made(lambda pem: pem * 3_000),
        "after text": made(lambda pem: b"a\n" * 900_000 + pem),
        "truncated": made(lambda pem: pem[:-40]),
        "not closed": made(lambda pem: pem.partition(b"\n")[0] + b"\n" + body * 60_000),
        "long": made(lambda pem: pem.partition(b"\n")[0] + b"\n" + body * 60_000
                     + pem[pem.index(b"-----END"):]),
        "encrypted": encrypted,
        "odd cipher": b"-----BEGIN EC PRIVATE KEY-----\nProc-Type: 4,ENCRYPTED\nDEK-Info: "
        + b"A" * 90_000 + b"\n\n" + body + b"-----END EC PRIVATE KEY-----\n",
    }  # fmt: skip


def encrypted(path: Path) -> None:
    """A key with a pass phrase, which nobody is there to type."""
    command = ["openssl", "pkey", "-aes256", "-passout", "pass:secret", "-out", str(path)]
    subprocess.run(command, input=certificate()[1], check=True, capture_output=True)


SECRET_ATTACKS: Attacks = {
    "long": b"ab" * 900_000, "short": b"ab\n", "odd": b"a" * 63, "spaces": b" " * 900 + b"ab",
    "letters of others": "٣".encode() * 64, "not text": bytes(range(256)),
}  # fmt: skip


FORMATS = [
    Format(name="uavrt.toml", honest=b'[radio]\nkind = "airspy"\ngain = 12\n',
           attacks=toml_attacks("[radio]\n", "gain"),
           read=reader("uavrt.config.loader.load_settings")),
    Format(name="tags.toml", honest="".join(TAG.format(n) for n in range(2, 40)).encode(),
           attacks=toml_attacks("[[tag]]\n", "interval_ms") | {
               "many tags": "".join(TAG.format(n) for n in range(2, 8_000)).encode(),
               "near codes": "".join(
                   CODED.format(n, 30 + 0.03 * n) for n in range(2, 500)).encode(),
               "many codes": "".join(CODED.format(n, 30) for n in range(2, 6_000)).encode(),
               "gaps": CODED.format(2, "1," * 80_000 + "1").encode(),
           }, read=read_tag_file),
    table("TagInfo.txt", "2, 148712000, 1200, 20, 60, 10, 3, 0.01\n", read_tag_file),
    table("codes.csv", f"{CODES}12,166.38,5.3,22.1,48.8,36.6\n", read_tag_file, more={
        "heading": ",".join(f"g{n % 9 + 1}" for n in range(90_000)).encode() + b"\n1\n",
        "many": CODES.encode() + b"".join(
            b"%d,166.38,5.3,22.1,48.8,%d\n" % (n, n) for n in range(25_000))}),
    Format(name="codes.yaml", honest=b"- id: 12\n  frequency_mhz: 166.38\n  burst_interval_s:"
           b" 5.3\n  gaps_ms: [22.1, 48.8, 36.6]\n", attacks={
               "many": b"- {id: 1, gaps_ms: [1, 2, 3]}\n" * 25_000,
               "just within": b"- {id: 1, gaps_ms: [1, 2, 3]}\n" * 4_800,
               "nested": b"[" * 60_000,
               "aliases": b"a: &a [1]\nb: [*a, *a]\n",
               "scalars": b"- x\n" * 37_000,
               "folded": b"a: >\n" + b"  x\n" * 30_000,
               "documents": b"---\n" * 35_000,
               "quoted": b'- "' + b"\\x41" * 36_000 + b'"\n',
               "indents": b"".join(b" " * n + b"a:\n" for n in range(500)),
               "colons": b"? " * 60_000,
           }, read=read_tag_file),
    table("TagInfo.db", "1,2,Luna,3,148.712\n", import_tags),
    table("tags.csv", TAGS, import_tags),
    Format(name="area.geojson", honest=geojson(corners(8)), attacks=SHAPE_ATTACKS,
           read=read_shape),
    Format(name="area.kml", honest=kml(placemark(8)), attacks=SHAPE_ATTACKS, read=read_shape),
    Format(name="area.plan", honest=plan([[47, 8], [47.01, 8], [47.01, 8.01]]),
           attacks=SHAPE_ATTACKS, read=read_shape),
    Format(name="log.ulg", honest=ULOG, attacks={
        "zeros": ULOG + bytes(12_000_000),
        "5 GB of zeros": sparse(b"ULog\x01\x12\x35\x01" + bytes(8), 5_000_000_000),
        "1.9 GB of zeros": sparse(ULOG, 1_900_000_000),
        "fives": ULOG + b"\5\0\0" * 3_000_000,
        "no data": ulog([*ADDED], ULOG_FORMATS),
        "huge array": ulog_of_fields(b"float[999999999] q;"),
        "nested types": ulog_of_fields(
            b"a[900] x;", b"a:b[900] x;", b"b:c[900] x;", b"c:uint8_t[900] x;"),
        "type of itself": ulog_of_fields(b"a x;", b"a:a x;"),
        "many formats": ulog([*ADDED, *FLOWN], [*ULOG_FORMATS, *(
            b"t%d:uint64_t timestamp;uint8_t[9] a;" % n for n in range(20_000))]),
        "long text": ulog([*ADDED, (b"L", b"6" + bytes(8) + b"x" * 60_000)] * 50, ULOG_FORMATS),
        "information": ulog([(b"M", b"\0\x09char[3] aabc")] * 60_000, ULOG_FORMATS),
        "drop-outs": ulog([*ADDED, *FLOWN, *[(b"O", b"\1\0")] * 60_000], ULOG_FORMATS),
        "far times": ulog([*ADDED, *[
            (b"D", struct.pack("<HQQ", 2, 2**63 * (n % 2), 2**64 - 1)) for n in range(50)],
            *FLOWN], ULOG_FORMATS),
    }, read=read_any_track),
    Format(name="log.BIN", honest=dataflash(), attacks={
        "marks": b"\xa3\x95\x80" * 1_000_000,
        "no formats": b"\xa3\x95\x82" * 1_000_000,
        "empty messages": fmt(128, b"FMT", b"BBnNZ", b"T,L,N,F,C", 89)
        + fmt(130, b"ATT", b"", b"", 3) + b"\xa3\x95\x82" * 700_000,
        "empty names": dataflash() + fmt(130, b"ATT", b"Q", b"", 11) + b"\xa3\x95\x82" * 1000,
        "long": late(lambda: dataflash(12_000)),
        "zeros": dataflash() + bytes(30_000_000),
        "letters": dataflash() + b"\xa3" * 10_000_000,
        "formats": b"".join(
            fmt(n % 127, b"ATT", b"Q" * 16, b"TimeUS", 131) for n in range(60_000)),
        "far times": dataflash() + b"\xa3\x95\x82" + struct.pack(
            "<Qfff", 2**64 - 1, 1e38, float("nan"), float("inf")),
        "1.9 GB": sparse(dataflash(), 1_900_000_000),
    }, read=read_any_track),
    Format(name="log.tlog", honest=tlog(), attacks={
        "markers": b"\0" * 8 + b"\xfd" * 1_000_000,
        "old markers": b"\0" * 8 + b"\xfe\xff" * 500_000,
        "zeros": tlog() + bytes(4_000_000),
        "long": tlog(6_000),
        "far times": b"\xff" * 8 + tlog()[8:],
        "1.9 GB": sparse(tlog(), 1_900_000_000),
    }, read=read_any_track),
    Format(name="track.gpx", honest=gpx("".join(map(trkpt, range(60)))), attacks=GPX_ATTACKS,
           read=read_any_track),
    Format(name="track.nmea", honest=NMEA, attacks={
        "long": NMEA * 30, "wide": NMEA + b"$GPRMC," * 200_000,
        "stars": b"$GP" + b"*" * 900_000, "far": NMEA.replace(b"010526", b"999999"),
    }, read=read_any_track),
    table("telemetry.csv", TELEMETRY, read_any_track),
    Format(name="N47E008.hgt", honest=bytes(2 * 1201 * 1201), attacks={
        "short": bytes(1000), "other size": bytes(2 * 1200 * 1200)}, read=read_heights),
    Format(name="N47E008.hgt.zip", honest=zipped("N47E008.hgt", bytes(2 * 1201 * 1201)),
           attacks={
               "bomb": late(lambda: zipped("N47E008.hgt", bytes(150_000_000))),
               "bomb by LZMA": late(
                   lambda: zipped("N47E008.hgt", bytes(25_934_402), zipfile.ZIP_LZMA)),
               "bomb by bzip2": late(
                   lambda: zipped("N47E008.hgt", bytes(25_934_402), zipfile.ZIP_BZIP2)),
               "honest second": late(lambda: zipped("N47E008.hgt", bytes(25_934_402))),
               "two": zipped("N47E008.hgt", b"")[:-22] + zipped("N47E009.hgt", b""),
               "directory": b"PK\1\2" + bytes(42) * 600_000 + b"PK\5\6" + struct.pack(
                   "<4H2IH", 0, 0, 65535, 65535, 46 * 500_000, 0, 0),
           }, read=read_heights),
    Format(name="heights.tif", honest=geotiff(), attacks={
        "bomb": late(lambda: geotiff(4000, 8, zlib.compress(bytes(300_000_000)))),
        "large strip": late(lambda: geotiff(4000, 8, zlib.compress(bytes(2 * 4000 * 4000)))),
        "LZW": geotiff(4000, 5, bytes(random.Random(2).randbytes(100_000))),
        "PackBits": geotiff(4000, 32773, b"\x81\0" * 250_000),
        "PackBits of nothing": geotiff(4000, 32773, b"\x80" * 2_000_000),
        "many blocks": geotiff(100, 8, None, 290_000),
        "too many blocks": geotiff(100, 8, None, 900_000),
        "lies far away": tiff({256: (4, 1, b"\xff\xff\xff\x7f"), 257: (4, 1, b"\1\0\0\0")}),
        "one tag": tiff({256: (4, 2**31, b"\0\0\0\0\0\0\0\0")}),
        "endless directory": struct.pack("<2sHI", b"II", 42, 8) + b"\xff\xff" + bytes(90_000),
    }, read=read_heights),
    Format(name="map.mbtiles", honest=sqlite(*MBTILES), attacks={
        "endless metadata": sqlite(*MBTILES[1:2], MBTILES[3], "CREATE VIEW metadata AS "
                                   f"{ENDLESS} SELECT 'name' || i AS name, i AS value FROM n"),
        "endless tiles": sqlite(MBTILES[0], f"CREATE VIEW tiles AS {ENDLESS} SELECT i AS"
                                " zoom_level, 0 AS tile_column, 0 AS tile_row, '' AS tile_data"
                                " FROM n WHERE i < 0"),
        "endless order": sqlite(MBTILES[0], f"CREATE VIEW tiles AS {ENDLESS} SELECT i AS"
                                " zoom_level, 0 AS tile_column, 0 AS tile_row, '' AS tile_data"
                                " FROM n"),
        "long values": sqlite(*MBTILES, "INSERT INTO metadata VALUES ('attribution',"
                              " hex(zeroblob(40000000)))"),
        "made values": sqlite(*MBTILES[1:2], MBTILES[3], "CREATE VIEW metadata AS SELECT"
                              " 'attribution' AS name, hex(zeroblob(400000000)) AS value"),
        "markup": sqlite(*MBTILES, f"INSERT INTO metadata VALUES ('attribution',"
                         f" '{'<' * 500_000}')"),
        "NULL": sqlite(*MBTILES, "INSERT INTO metadata VALUES ('attribution', NULL),"
                       " (NULL, NULL), ('bounds', NULL)"),
        "bounds": sqlite(*MBTILES, "INSERT INTO metadata VALUES ('bounds', 'nan,1e999,x')"),
        "no numbers": sqlite(MBTILES[0], MBTILES[1], "INSERT INTO tiles VALUES"
                             " ('a', 'b', NULL, NULL)"),
        "large zoom": sqlite(MBTILES[0], MBTILES[1], "INSERT INTO tiles VALUES"
                             " (9223372036854775807, 1, 1, x'00')"),
    }, read=read_map_file),
    Format(name="map.pmtiles", honest=pmtiles(bytes((1, 1, 1, 4, 1))), attacks={
        "bomb": pmtiles(bytes(80_000_000)),
        "large directory": pmtiles(b"\xff\xff\x7f" + bytes(1_400_000)),
        "facts": pmtiles(bytes((1, 1, 1, 4, 1)), b"[" * 80_000),
        "long facts": pmtiles(bytes((1, 1, 1, 4, 1)), b'{"attribution":"' + b"<" * 900_000
                              + b'"}'),
        "leaf of itself": pmtiles(bytes((1, 0, 0, 100, 1)), leaves=127),
        "far": pmtiles(bytes((1, 1, 1, 4, 1)), data=2**63),
        "long numbers": pmtiles(b"\x80" * 1_000_000),
    }, read=read_map_file),
    Format(name="rec.sigmf-meta", honest=sigmf(), attacks={
        "captures": sigmf_captures(*[{"core:sample_start": n} for n in range(40_000)]),
        "far capture": sigmf_captures({"core:sample_start": 2**62, "core:global_index": 2**62}),
        "negative capture": sigmf_captures({"core:sample_start": -1}),
        "text": sigmf_captures({"core:sample_start": "1"}),
        "rate": json.dumps({**SIGMF, "global": {
            "core:datatype": "cf32_le", "core:sample_rate": 1e308}}).encode(),
        "no rate": json.dumps({**SIGMF, "global": {
            "core:datatype": "cf32_le", "core:sample_rate": float("nan")}}).encode(),
        "dates": sigmf(captures=[{"core:sample_start": 0,
                                  "core:datetime": "9" * 40_000 + "-01-01T00:00:00Z"}]),
        "nested": b'{"global":' * 20_000,
        "annotations": sigmf(annotations=[{}] * 300_000),
    }, read=read_samples),
    Format(name="SDRSharp_20260501_081500Z_148700000Hz_IQ.wav",
           honest=riff((b"fmt ", 16, WAVE), (b"data", 4000, bytes(4000))),
           attacks={
               "far chunk": riff((b"fmt ", 16, WAVE), (b"data", 2**32 - 1, bytes(400))),
               "chunks": riff(*[(b"junk", 0, b"")] * 300_000),
               "no format": riff((b"data", 4, bytes(4))),
               "rate": riff((b"fmt ", 16, struct.pack("<HHIIHH", 1, 2, 0, 0, 4, 16))),
               "channels": riff((b"fmt ", 16, struct.pack("<HHIIHH", 1, 65535, 8000, 0, 0, 0)),
                                (b"data", 4, bytes(4))),
               "SpectraVue": riff((b"fmt ", 16, WAVE), (b"auxi", 400_000, b"<a>" * 133_333),
                                  (b"data", 4, bytes(4))),
               "64 bits": b"RF64\xff\xff\xff\xffWAVEds64\x1c\0\0\0" + b"\xff" * 28,
           }, read=read_samples),
    *(Format(name=name, honest=NOISE, attacks=RAW_ATTACKS, read=read_samples,
             mb_s=24.0 / sample_bytes)
      for name, sample_bytes in (("rec.cf32", 8), ("rec.cs16", 4), ("rec.cu8", 2),
                                 ("rec.ci8", 2), ("rec_148.7MHz_48ksps.cfile", 8))),
    Format(name="page.pem", honest=late(lambda: certificate()[0]),
           attacks=pem_attacks(0), read=read_certificate),
    Format(name="page.key", honest=late(lambda: certificate()[1]),
           attacks=pem_attacks(1), read=read_certificate),
    Format(name="drone.key", honest=b"ab" * 32, attacks=SECRET_ATTACKS, read=read_secret),
    *(records(name, record, start_ground)
      for name, record in (("ground.json", STATION), ("tag_corrections.jsonl", CORRECTION),
                           ("ground_log.jsonl", LOG_LINE), ("flight_list.json", KNOWN),
                           ("supervisor_state.json", SAVED))),
    *(records(name, record, start_drone)
      for name, record in (("supervisor_state.json", SAVED),
                           ("parameters.json", {"DET_K": {"value": 5.0, "instead_of": 3.0}}),
                           ("signing_times.json", {"boot_id": "a", "times": {"newest": 9}}),
                           ("last_tags.json", [KEPT_TAG]))),
    Format(name="pulses.jsonl", honest=pulses(), attacks={
        "long": pulses(8_000),
        "nested field": pulses(1)[:-2] + b', "x": ' + b"[" * 50_000 + b"\n",
        "wide": pulses(1, detection_status="x" * 500_000),
        "not finite": pulses(5, snr_db=float("inf"), latitude_deg=float("nan")),
        "far times": pulses(5, start_time_ns=10**30),
        "whole": pulses(5, tag_id=10**4000),
        "other kinds": pulses(5, quaternion_wxyz={"a": 1}, tag_id=[1]),
        "damaged lines": b'{"tag_id": }\n' * 30_000,
    }, read=read_pulses),
    table("Pulse-1.csv", ROW_2023, read_pulses, rows=30),
    table("pings.csv", UCSD, read_pulses),
    table("hits.csv", HITS, read_pulses),
    table("signals.csv", SIGNALS, read_pulses, separator=";"),
    table("estimates.csv", ESTIMATES, reader("uavrt.formats.pulses.ucsd.read_ucsd_estimates")),
    table("pulse_pose_log.txt", THESIS_ROW, read_pulses, rows=20),
    table("antenna.csv", ANTENNA, reader("uavrt.analysis.measure.antenna_files.read_antenna"),
          more={"huge": b"1e308,1\n" * 200 + b"0,1e308\n180,-1e308\n",
                "many": b"".join(b"%d,-1\n" % n for n in range(60_000))}),
    table("gnome.txt", GNOME, read_pulses, rows=20),
    table("bearings.csv",
          "2,a.csv,92.5,0.9,47.4,8.496688,40.0,500.0,1700000000.5,1700000060.5,2.0\n",
          reader("uavrt.formats.bearings_csv.read_bearing_file"), rows=20),
    table("positions.csv", "2,a.csv,47.4,8.5,47.4,8.5,47.4,8.5\n",
          reader("uavrt.formats.positions_csv.read_position_file"), rows=20),
    Format(name="detectorConfig.txt", honest=DETECTOR, attacks={
        "long": DETECTOR * 5_000, "headings": b"#\n" * 90_000, "colons": b":" * 190_000,
        "far": DETECTOR.replace(b"1.2", b"9" * 5000)},
        read=reader("uavrt.flight.logs.detector_configs.read_detector_config")),
    Format(name="report.toml", honest=b'operator = "A. Adler"\n',
           attacks=toml_attacks("", "operator"),
           read=reader("uavrt.analysis.inputs.flight_facts.read_facts")),
    Format(name="scenario.toml", honest=b"",
           attacks=toml_attacks("[radio]\n", "sample_rate_hz"),
           read=reader("uavrt.simulation.scene.scenario_file.load_scenario")),
    table("recordings.csv", "path,format\na.wav,wav\n",
          reader("uavrt.analysis.archive.recordings.read_manifest"), rows=0),
    Format(name="uavrt-9.tar", honest=update_tar(b"{}"), attacks={
        "large manifest": update_tar(b"[" * 3_000_000), "members": update_tar(
            b"{}", *[tarfile.TarInfo(f"wheels/{n}") for n in range(9_000)])},
        read=read_update_file, is_read=False),
    Format(name="uavrt-9.9-py3-none-any.whl", honest=zipped("a", b"a"), attacks={
        "bomb": late(lambda: zipped("a", bytes(90_000_000)))},
        read=read_update_file, is_read=False),
    Format(name="flight.sqlite", honest=honest_flight, attacks=flight_attacks(),
           read=read_whole_flight),
    records("tags.json", [VERDICT], read_verdicts, {
        "parts": {"parts": [{}] * 100_000}, "rings": {"region50": [[[10**400, 1]]]},
        "searched": {"searched": {"a": 10**400}},
        "listened": {"listened": "2026-01-01T00:00:00Z/2026-01-01T00:00:01Z " * 200_000},
        "lists": {"remarks": ["x"] * 400_000}}),
    records("folds.json", [FOLD], read_verdicts, {
        "not finite": {"tag_id": float("inf")},
        "wide": {"profile": [0] * 200_000, "raster": [[0] * 200_000]},
        "tall": {"profile": [0], "raster": [[0]] * 150_000},
        "square": {"profile": [0] * 600, "raster": [[0] * 600] * 600}}),
    *(Format(name=name, honest=archive_file(place), attacks={}, read=archive_with(place))
      for name, place in (
          ("recordings.parquet", "recordings.parquet"), ("pulses.parquet", "pulses/*"),
          ("copies.json", "copies.json"), ("done.json", "done/*"))),
]  # fmt: skip


# ------------------------------------------------------------------- the campaign


def mutated(content: bytes, rng: random.Random) -> bytes:
    """Change some bytes, cut, repeat or exchange pieces, or put numbers of others' size in."""
    made = bytearray(content[:3_000_000])
    for _ in range(rng.randint(1, 6)):
        at, length = rng.randrange(len(made) + 1), rng.randrange(1, 64)
        match rng.randrange(6):
            case 0 if made:
                made[at % len(made)] ^= 1 << rng.randrange(8)
            case 1:
                del made[at : at + length]
            case 2:
                made[at:at] = made[at : at + length] * rng.choice((2, 50, 2_000))
            case 3:
                del made[at:]
            case 4:
                odd = (
                    b"nan",
                    b"-1",
                    b"1e999",
                    b"9" * 400,
                    b'"',
                    b"\0",
                    b"\xff" * 8,
                    b"[" * 500,
                )
                made[at : at + rng.randrange(8)] = rng.choice(odd)
            case _:
                other = rng.randrange(len(made) + 1)
                made[at:at] = made[other : other + 20 * length]
    return bytes(made[:6_000_000])


def known_files(one: Format) -> Attacks:
    """All files of a format but its mutations."""
    common = {name: made for name, made in COMMON.items() if name != "3 GB" or not one.mb_s}
    return {"honest": one.honest, **one.attacks, **common}


def files_of(one: Format, count: int, rng: random.Random) -> Iterator[tuple[str, Content]]:
    """Some files of a format: each attack once, as far as the count goes, then mutations."""
    known = known_files(one)
    names = list(known)
    first = ["honest", *rng.sample(names[1:], len(names) - 1)][:count]
    for name in first:
        yield name, known[name]
    for number in range(count - len(first)):
        name = rng.choice(["honest"] * 3 + names)
        yield f"{name}, mutated {number}", (name, rng.randrange(2**32))  # type: ignore[misc]


def write(one: Format, content: object, path: Path) -> None:
    """Make a file where it is to be."""
    if isinstance(content, tuple):
        name, seed = content
        write(one, known_files(one)[name], path)
        if path.is_fifo() or path.stat().st_size > 50_000_000:
            return
        path.write_bytes(mutated(path.read_bytes(), random.Random(seed)))
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        content(path)  # type: ignore[operator]


def tried(one: Format, path: Path, limit_s: int = 6) -> Outcome:
    """Read a file in a process of its own."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _read(one, path, writer, limit_s)
    os.close(writer)
    with os.fdopen(reader, "rb") as answer:
        told = answer.read()
    _, status, used = os.wait4(child, 0)
    if not told:
        code = os.waitstatus_to_exitcode(status)
        return Outcome(what="killed", text=str(code), cpu_s=used.ru_utime, peak_bytes=0)
    return Outcome(**json.loads(told))


def _read(one: Format, path: Path, answer: int, limit_s: int) -> None:
    """In the child: read, and say what came of it."""
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
        resource.setrlimit(resource.RLIMIT_AS, (4_000_000_000, 4_000_000_000))
        signal.alarm(10 * limit_s)
        with contextlib.suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5")  # peaks count from here
        base = _memory("VmRSS")
        before = resource.getrusage(resource.RUSAGE_SELF)
        what, text = "read", ""
        try:
            one.read(path)
        except UavrtError as error:
            what, text = "refused", str(error)
        except BaseException as error:  # noqa: BLE001 - whatever it is
            what, text = "traceback", f"{type(error).__name__}: {error}"[:300]
        after = resource.getrusage(resource.RUSAGE_SELF)
        cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        peak = PROGRAM_BYTES + _memory("VmHWM") - base
        told = {"what": what, "text": text[:41_000], "cpu_s": cpu_s, "peak_bytes": peak}
        with os.fdopen(answer, "w") as stream:
            json.dump(told, stream)
    finally:
        os._exit(0)


def _memory(what: str) -> int:
    """Bytes that this process has, or had at most."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.partition(f"{what}:")[2].split()[0])


def warm_up(one: Format) -> None:
    """Import what a reader needs: its time and memory are the program's, not a file's."""
    with tempfile.TemporaryDirectory() as name, contextlib.suppress(UavrtError):
        write(one, one.honest, Path(name) / one.name)
        one.read(Path(name) / one.name)


def run(
    formats: list[Format],
    each: int,
    seed: int,
    say: Callable[[str], None] = print,
    *,
    warm: bool = True,
) -> tuple[int, list[str]]:
    """Try some files of each format; how many, and what is not as it should be."""
    faults, total = [], 0
    for one in formats:
        if warm:
            warm_up(one)
        rng = random.Random(f"{seed} {one.name}")
        worst_s, worst_bytes, refused, count = 0.0, 0, 0, 0
        for what, content in files_of(one, each, rng):
            with tempfile.TemporaryDirectory() as name:
                path = Path(name) / one.name
                write(one, content, path)
                most_s = CPU_S + (1e-6 * path.stat().st_size * one.mb_s if one.mb_s else 0.0)
                found = tried(one, path, round(most_s) + 4)
            count += 1
            refused += found.what == "refused"
            worst_s, worst_bytes = max(worst_s, found.cpu_s), max(worst_bytes, found.peak_bytes)
            fault = found.fault(most_s)
            if what == "honest" and one.is_read and found.what != "read":
                fault = f"the honest file is {found.what}: {found.text}"
            if fault is not None:
                faults.append(f"{one.name}, {what}: {fault}")
                say(f"  NOT SO {faults[-1]}")
        total += count
        say(f"{one.name:28}{count:5} files,{refused:5} refused, {worst_s:5.2f} s, "
            f"{worst_bytes / 1e6:4.0f} MB")  # fmt: skip
    return total, faults


def main() -> None:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description="Try files of all foreign formats.")
    parser.add_argument("--files", type=int, default=2400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="part of a format's name")
    parser.add_argument("--part", default="0/1", help="of the formats, such as 1/2 of two")
    given = parser.parse_args()
    part, parts = map(int, given.part.split("/"))
    chosen = [one for one in FORMATS[part::parts] if given.only in one.name]
    total, faults = run(chosen, -(-given.files // len(FORMATS)), given.seed)
    print(f"{total} files, {len(faults)} not as they should be")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
