"""Read pulse files of a SensorGnome, and detections of find_tags.

A pulse file has a line for each record; the first cell is the kind of record::

    p1,1366227448.192,4.056,-44.4,-50.55      port; time, kHz from the tuned frequency, dB, dB
    S,1366227421.0,1,-m,166.376,0,            port, parameter, value: -m or frequency is MHz
    G,1366227448.0,44.3405,-66.1185,21.7      time, latitude, longitude, altitude

Other lines are ignored. A SensorGnome begins a new file each hour, but writes the S lines only
after its start: a file without them takes those of other files in its folder.

Detections have a heading with ``ts``, ``id`` and ``sig``; ``freq`` is in kilohertz from the
tag's nominal frequency, which ``tagFreq`` or ``nomFreq`` gives in MHz. Neither kind has compass
headings, so the poses have none, and bearings are impossible.
"""

import math
import os
import re
from bisect import bisect_left
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from uavrt.core.earth.geodesy import are_one_place
from uavrt.core.errors import FormatError
from uavrt.core.messages import Pose, Pulse, PulsePose
from uavrt.core.units import hz_from_mhz, ns_from_s
from uavrt.formats.damaged_lines import passed_over
from uavrt.formats.pulses.pulse_log import PulseLog, ungrouped_pulse
from uavrt.formats.pulses.ucsd import tag_numbers
from uavrt.formats.text import (
    MAX_TIME_NS,
    cells_of,
    finite,
    latitude,
    longitude,
    number_or_nan,
    place_or_none,
    read_lines,
    seconds_ns,
    whole,
    wrong_line,
)

SAME_TAG_HZ = 2_000.0
"""Maximum difference between the frequencies of one tag without a code [Hz]."""
DETECTION_NAMES = {"ts", "id", "sig"}
_PORT = re.compile(r"p[A-Za-z]?(\d+)")
_PULSE_NS = ns_from_s(0.0025)
_TUNED = ("-m", "frequency", "freq")
_MOST_SIBLINGS = 100
"""Maximum number of files of a folder that are searched for S lines."""
_NOMINAL = ("tagfreq", "nomfreq", "mfgfreq")
_LONGEST_NS = ns_from_s(60.0)
"""Maximum time between a pulse and a position of a moving receiver that is used for it [ns]; a
SensorGnome records a position every five minutes."""
_REMEDY = (
    "A pulse line is p1,time,kHz,signal,noise; a detection has ts, id, sig. Put the first file "
    "after the receiver's start, which has the S lines, into the same folder"
)
NO_HEADINGS = (
    "This log has no headings: positions follow from strength alone, as with a monopole. "
    "`uavrt attach` gives its pulses the poses of another log."
)
NUMBERED = (
    "Pulses of this log are numbered by frequency, not by code: `uavrt attach --tags` groups "
    "them into bursts of listed codes."
)

Place = tuple[int, float, float, float]
"""GPS position: time [ns], latitude and longitude [deg], altitude above mean sea level [m]."""


def is_pulse_file(lines: Sequence[str]) -> bool:
    """True if the first non-empty lines are those of a SensorGnome's pulse file."""
    some = [cells_of(line) for line in lines[:200]]
    known = [cells for cells in some if cells and _kind(cells[0])]
    content = [cells for cells in some if cells]
    return len(known) * 2 > len(content) and any(len(cells) >= 4 for cells in known)


def _kind(cell: str) -> str | None:
    if _PORT.fullmatch(cell):
        return "p"
    return cell if cell in ("S", "G", "C") else None


def is_detections(cells: Sequence[str]) -> bool:
    """True if a CSV heading is that of the detections written by find_tags."""
    return {cell.strip('" ').lower() for cell in cells} >= DETECTION_NAMES


def read_pulse_lines(path: str | os.PathLike[str]) -> PulseLog:
    """Read a pulse file and count damaged lines; raises `FormatError` if most are damaged."""
    lines = read_lines(path)
    tuned_hz, sources = _tuned_elsewhere(Path(path), lines)
    pulses: list[Pulse] = []
    places: list[Place] = []
    damaged = 0
    first: tuple[int, object] | None = None
    for number, line in enumerate(lines, start=1):
        cells = cells_of(line)
        kind = _kind(cells[0]) if cells else None
        try:
            if kind == "p":
                port = _port(cells[0])
                if port not in tuned_hz:
                    raise ValueError(f"no earlier S line gives the frequency of port {port}")
                pulses.append(_pulse(cells, tuned_hz[port]))
            elif kind == "S" and _is_tuning(cells):
                tuned_hz[cells[2]] = hz_from_mhz(finite(cells[4]))
            elif kind == "G":
                places.append(_place(cells[1:5]))
        except (ValueError, IndexError, OverflowError) as error:
            damaged += 1
            first = first or (number, error)
    if first is not None and damaged > len(pulses):
        raise wrong_line(path, *first, _REMEDY)
    warnings = [NUMBERED, NO_HEADINGS, *sources] if places else [NUMBERED, *sources]
    if first is not None:
        warnings.append(passed_over(os.fspath(path), damaged, *first))
    numbers = tag_numbers([pulse.frequency_hz for pulse in pulses], SAME_TAG_HZ)
    posed = _posed(sorted(zip(pulses, numbers, strict=True), key=_start), sorted(places))
    return PulseLog(
        kind="sensorgnome",
        pulse_poses=posed,
        warnings=tuple(warnings) if pulses else (),
        passed_over=damaged,
    )


def _is_tuning(cells: Sequence[str]) -> bool:
    """True if an S line gives the frequency to which a port is tuned."""
    return len(cells) >= 5 and cells[3].strip('"') in _TUNED


def _tuned_elsewhere(path: Path, lines: Sequence[str]) -> tuple[dict[str, float], list[str]]:
    """Return the frequencies [Hz] of ports for which a file has no S line, from the pulse files
    in its folder, and a note on each.

    Earlier files of the same start of the receiver come first (their names begin alike:
    station-serial-start-); if there are none, all files of the folder that agree.
    """
    wanted = {_port(first) for line in lines if _kind(first := line.partition(",")[0]) == "p"}
    wanted -= set(_tunings(lines))
    every = sorted(path.parent.glob("*.txt*")) if wanted else []
    files = [one for one in every if one != path and one.name.endswith((".txt", ".txt.gz"))]
    same = [one for one in files if _start_of(one) == _start_of(path) and one.name < path.name]
    read = [*reversed(same[1:][-_MOST_SIBLINGS:]), *same[:1]] or files[:_MOST_SIBLINGS]
    found: dict[str, dict[float, Path]] = {port: {} for port in wanted}
    for other in read:
        for port, hz in _tunings_of(other, other.stat().st_mtime_ns).items():
            if port in wanted and not (same and found[port]):
                found[port].setdefault(hz, other)
    tuned_hz: dict[str, float] = {}
    notes = []
    for port, frequencies in sorted(found.items()):
        if len(frequencies) == 1:
            ((tuned_hz[port], other),) = frequencies.items()
            notes.append(
                f"{path.name} has no S line for port {port}: its frequency, "
                f"{tuned_hz[port] / 1e6:.3f} MHz, is that of {other.name}"
            )
    return tuned_hz, notes


def _start_of(path: Path) -> str:
    """Beginning of a file's name that is the same for all files of one start of a receiver."""
    parts = path.name.split("-")
    return "-".join(parts[:3]) if len(parts) > 3 else path.name


@lru_cache(maxsize=10_000)
def _tunings_of(path: Path, _changed_ns: int) -> dict[str, float]:
    try:
        return _tunings(read_lines(path))
    except FormatError:
        return {}


def _tunings(lines: Sequence[str]) -> dict[str, float]:
    """Return the last frequency to which each port is tuned by the S lines [Hz]."""
    found = {}
    for line in lines:
        cells = cells_of(line) if line.startswith("S,") else []
        if _is_tuning(cells):
            with suppress(ValueError):
                found[cells[2]] = hz_from_mhz(finite(cells[4]))
    return found


def _port(cell: str) -> str:
    found = _PORT.fullmatch(cell)
    assert found is not None
    return found[1]


def _start(item: tuple[Pulse, int]) -> int:
    return item[0].start_time_ns


def _pulse(cells: Sequence[str], tuned_hz: float) -> Pulse:
    start_ns = seconds_ns(cells[1])
    signal_db, noise_db = number_or_nan(cells[3]), number_or_nan(cells[4])
    if abs(noise_db) > 300.0:
        raise ValueError(f"{cells[4]} is not a level in dB")
    return ungrouped_pulse(
        1,
        tuned_hz + 1e3 * finite(cells[2]),
        start_ns,
        start_ns + _PULSE_NS,
        signal_db - noise_db,
        noise_db=noise_db,
        confirmed=False,
    )


def _place(cells: Sequence[str]) -> Place:
    altitude_m = number_or_nan(cells[3]) if len(cells) > 3 else math.nan
    return seconds_ns(cells[0]), latitude(cells[1]), longitude(cells[2]), altitude_m


def _posed(pulses: list[tuple[Pulse, int]], places: list[Place]) -> tuple[PulsePose, ...]:
    times_ns = [place[0] for place in places]
    longest_ns = MAX_TIME_NS if are_one_place([place[1:3] for place in places]) else _LONGEST_NS
    base_m = next((place[3] for place in places if math.isfinite(place[3])), math.nan)
    return tuple(
        PulsePose(
            pulse=replace(pulse, tag_id=tag_id),
            pose=_between(pulse.start_time_ns, places, times_ns, base_m, longest_ns),
        )
        for pulse, tag_id in pulses
    )


def _between(
    time_ns: int, places: list[Place], times_ns: list[int], base_m: float, longest_ns: int
) -> Pose | None:
    """Pose without heading at a time, interpolated between positions at most `longest_ns` away;
    None without one.
    """
    after = bisect_left(times_ns, time_ns)
    near = [
        place
        for place in places[max(0, after - 1) : after + 1]
        if abs(place[0] - time_ns) <= longest_ns
    ]
    if not near:
        return None
    one, two = near[0], near[-1]
    share = (time_ns - one[0]) / (two[0] - one[0]) if two[0] > one[0] else 0.0
    lat, lon, alt = (a + share * (b - a) for a, b in zip(one[1:], two[1:], strict=True))
    return _pose(time_ns, lat, lon, alt, base_m)


def _pose(time_ns: int, lat: float, lon: float, alt: float, base_m: float) -> Pose:
    return Pose(
        time_ns=time_ns,
        latitude_deg=lat,
        longitude_deg=lon,
        altitude_amsl_m=alt,
        altitude_relative_m=alt - base_m,
        quaternion_wxyz=(1.0, 0.0, 0.0, 0.0),
    )


def read_detections(path: str | os.PathLike[str]) -> PulseLog:
    """Read the detections of find_tags, one burst per row; a `FormatError` names a bad row."""
    names: list[str] | None = None
    found: list[PulsePose] = []
    lines = read_lines(path)
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip().strip('"') for cell in line.split(",")]
        if not any(cells):
            continue
        try:
            if names is None:
                names = [cell.lower() for cell in cells]
                continue
            found.append(_detection(dict(zip(names, cells, strict=False))))
        except (ValueError, KeyError, OverflowError) as error:
            if number == len(lines) and found:
                break  # cut off while it was written
            why = f"the column {error} is missing" if isinstance(error, KeyError) else error
            raise wrong_line(path, number, why, _REMEDY) from None
    placed = any(one.pose is not None for one in found)
    return PulseLog(
        kind="detections",
        pulse_poses=tuple(sorted(found, key=lambda one: one.pulse.start_time_ns)),
        warnings=(NO_HEADINGS,) if placed else (),
    )


def _detection(row: dict[str, str]) -> PulsePose:
    start_ns = seconds_ns(row["ts"])
    tag_id = whole(row["id"])
    if tag_id < 1:
        raise ValueError(f"the tag id {tag_id} is below 1")
    number = _reader(row)
    noise_db = number("noise")
    signal_db = number("sig")
    nominal_mhz = next((number(name) for name in _NOMINAL if row.get(name)), math.nan)
    away_khz = number("freq")
    away_hz = 1e3 * away_khz if math.isfinite(away_khz) else 0.0
    pulse = ungrouped_pulse(
        tag_id,
        1e6 * nominal_mhz + away_hz,
        start_ns,
        start_ns + _PULSE_NS,
        signal_db - (noise_db if math.isfinite(noise_db) else 0.0),
        noise_db=noise_db,
        confirmed=True,
    )
    place = place_or_none(row.get("lat", ""), row.get("lon", ""))
    if place is None:
        return PulsePose(pulse=pulse, pose=None)
    return PulsePose(pulse=pulse, pose=_pose(start_ns, *place, number("alt"), math.nan))


def _reader(row: dict[str, str]) -> Callable[[str], float]:
    return lambda name: number_or_nan(row.get(name, ""))
