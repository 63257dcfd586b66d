"""Export pulses and bursts for SensorGnome and Motus, two systems of automated telemetry.

SensorGnome's pulse file has one line for each pulse, in which ``find_tags`` searches for codes.
On each port, ``find_tags`` considers only tags of the nominal frequency nearest to the
frequency to which the port is tuned. So each nominal frequency gets a port of its own.

The file of detections has one row for each burst, with the columns that ``find_tags`` writes
and the nominal frequency, as in Motus. A pulse of an uncoded tag is exported as a burst of one
pulse without gaps.
"""

import io
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from uavrt.analysis.survey import Survey
from uavrt.core.messages import Pose, Pulse, PulsePose, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.formats.csv_line import TableWriter
from uavrt.formats.pulses.ucsd import tag_numbers

_SAME_HZ = 2_000.0
"""Largest frequency difference between bursts of the same unlisted tag [Hz]."""
_RUN_S = 60.0
"""Pause after which a tag's next burst begins a new run of bursts [s]."""
DETECTION_COLUMNS = (
    *("ant", "ts", "id", "name", "runID", "posInRun", "sig", "sigsd", "noise"),
    *("freq", "freqsd", "slop", "burstSlop", "lat", "lon", "alt"),
    "nomFreq",
)


def has_bursts(survey: Survey) -> bool:
    """True if any pulse or burst of a tag was received, so that there is a file to write."""
    return bool(_bursts(survey))


def _bursts(survey: Survey) -> list[PulsePose]:
    """Pulses and bursts above the threshold, as a SensorGnome records them, by time."""
    found = [one for one in survey.every_pulse if _written(one.pulse)]
    return sorted(found, key=lambda one: one.pulse.start_time_ns)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Port:
    number: int
    tuned_hz: float

    @property
    def tuned_mhz(self) -> str:
        """Frequency of the port [MHz], as find_tags reads it: three decimals or more."""
        whole, part = f"{self.tuned_hz / 1e6:.6f}".split(".")
        return f"{whole}.{part.rstrip('0'):0<3}"


def _ports(survey: Survey, bursts: Sequence[PulsePose]) -> list[_Port]:
    """Return the port of each burst; there is one port for each frequency of listed tags.

    An unlisted tag is assigned to a listed frequency within 2 kHz. If there is none, it gets
    the median of its bursts' frequencies, rounded to 1 kHz.
    """
    listed = [survey.tag(one.pulse.tag_id) for one in bursts]
    tuned_hz = [None if tag is None else tag.frequency_hz for tag in listed]
    nominal_hz = {hz for hz in tuned_hz if hz is not None}
    heard_hz = [one.pulse.frequency_hz for one in bursts]
    groups = tag_numbers(heard_hz, _SAME_HZ)
    for group in set(groups):
        inside = [place for place, number in enumerate(groups) if number == group]
        middle_hz = statistics.median(heard_hz[place] for place in inside)
        near_hz = min(nominal_hz, key=lambda hz: abs(hz - middle_hz), default=math.inf)
        if abs(near_hz - middle_hz) > _SAME_HZ:
            near_hz = round(middle_hz, -3)
        for place in inside:
            if tuned_hz[place] is None:
                tuned_hz[place] = near_hz
    all_hz = [hz for hz in tuned_hz if hz is not None]
    numbers = {hz: number for number, hz in enumerate(sorted(set(all_hz)), start=1)}
    return [_Port(number=numbers[hz], tuned_hz=hz) for hz in all_hz]


def _written(pulse: Pulse) -> bool:
    if pulse.burst_starts_ns:
        return True
    return pulse.detection_status != "subthreshold" and math.isfinite(pulse.frequency_hz)


def _levels(pulse: Pulse) -> list[tuple[int, float]]:
    """Start [ns] and SNR [dB] of each pulse in a burst; an uncoded tag's burst is one pulse."""
    if not pulse.burst_starts_ns:
        return [(pulse.start_time_ns, pulse.snr_db)]
    return list(zip(pulse.burst_starts_ns, pulse.burst_snrs_db, strict=True))


def sensorgnome_text(survey: Survey) -> str:
    """Write pulses, bursts and drone positions in SensorGnome's text format.

    A pulse is ``p<port>,<time>,<kHz from the tuned frequency>,<signal dB>,<noise dB>``; ``S``
    lines state a port's frequency in megahertz, and ``G`` lines a position. Levels are relative
    to 1 unit² of the samples.
    """
    bursts = _bursts(survey)
    if not bursts:
        return ""
    ports = _ports(survey, bursts)
    first = _seconds(bursts[0].pulse.start_time_ns)
    lines = [
        f"S,{first},{port.number},-m,{port.tuned_mhz},0,"
        for port in sorted(set(ports), key=lambda port: port.number)
    ]
    rows: list[tuple[int, str]] = []
    for one, port in zip(bursts, ports, strict=True):
        pulse = one.pulse
        if one.pose is not None:
            rows.append((pulse.start_time_ns, _place_line(pulse.start_time_ns, one.pose)))
        away_khz = (pulse.frequency_hz - port.tuned_hz) / 1e3
        noise_db = _noise_db(pulse)
        for start_ns, snr_db in _levels(pulse):
            begin = f"p{port.number},{_seconds(start_ns)},{away_khz:.3f}"
            rows.append((start_ns, f"{begin},{noise_db + snr_db:.2f},{noise_db:.2f}"))
    lines += [line for _, line in sorted(rows, key=lambda row: row[0])]
    return "\n".join(lines) + "\n"


def detections_csv(survey: Survey) -> str:
    """Write confirmed bursts and pulses, numbered by run, in the columns of ``find_tags``.

    ``freq`` is the difference from ``nomFreq`` in kilohertz; ``nomFreq`` is in megahertz.
    ``freqsd`` remains empty, since all pulses of a burst share one measured frequency.
    """
    stream = io.StringIO(newline="")
    writer = TableWriter(stream)
    writer.writerow(DETECTION_COLUMNS)
    last_ns: dict[int, int] = {}
    run: dict[int, tuple[int, int]] = {}
    runs = 0
    bursts = _bursts(survey)
    for one, port in zip(bursts, _ports(survey, bursts), strict=True):
        pulse, tag = one.pulse, survey.tag(one.pulse.tag_id)
        if not pulse.confirmed:
            continue
        before_ns = last_ns.get(pulse.tag_id)
        if before_ns is None or pulse.start_time_ns - before_ns > ns_from_s(_RUN_S):
            runs += 1
            run[pulse.tag_id], before_ns = (runs, 0), None
        number, place = run[pulse.tag_id]
        run[pulse.tag_id] = number, place + 1
        last_ns[pulse.tag_id] = pulse.start_time_ns
        noise_db = _noise_db(pulse)
        spread = statistics.stdev(pulse.burst_snrs_db) if len(pulse.burst_snrs_db) > 1 else 0.0
        away_khz = (pulse.frequency_hz - port.tuned_hz) / 1e3
        writer.writerow(
            (
                *(port.number, _seconds(pulse.start_time_ns), pulse.tag_id),
                survey.name_of(pulse.tag_id),
                *(number, place + 1, f"{noise_db + pulse.snr_db:.2f}", f"{spread:.2f}"),
                *(f"{noise_db:.2f}", f"{away_khz:.3f}", ""),
                *(_slop(pulse, tag), _burst_slop(pulse, tag, before_ns)),
                *_place(one.pose),
                port.tuned_mhz,
            )
        )
    return stream.getvalue()


def _seconds(time_ns: int) -> str:
    whole, part = divmod(time_ns, NANOSECONDS_PER_SECOND)
    return f"{whole}.{part // 1000:06d}"


def _noise_db(pulse: Pulse) -> float:
    return 10.0 * math.log10(pulse.noise_psd) if pulse.noise_psd > 0.0 else 0.0


def _slop(pulse: Pulse, tag: Tag | None) -> str:
    """Sum of a burst's gap errors against its code [s], as text; empty if unknown."""
    starts_ns: Sequence[int] = pulse.burst_starts_ns
    if tag is None or not starts_ns or len(starts_ns) != len(tag.gaps_s) + 1:
        return ""
    pairs = zip(starts_ns, starts_ns[1:], tag.gaps_s, strict=False)
    off_s = (abs((b - a) / NANOSECONDS_PER_SECOND - gap_s) for a, b, gap_s in pairs)
    return f"{sum(off_s):.5f}"


def _burst_slop(pulse: Pulse, tag: Tag | None, before_ns: int | None) -> str:
    """Difference between the time since the previous burst and a whole number of intervals [s],
    as text; 0 for the first burst.
    """
    if tag is None or before_ns is None:
        return "0"
    passed_s = (pulse.start_time_ns - before_ns) / NANOSECONDS_PER_SECOND
    rate = min(max(pulse.rate, 1), len(tag.pulse_intervals_s))
    interval_s = tag.pulse_intervals_s[rate - 1]
    return f"{passed_s - max(1, round(passed_s / interval_s)) * interval_s:.5f}"


def _place_line(time_ns: int, pose: Pose) -> str:
    return f"G,{_seconds(time_ns)}," + ",".join(_place(pose))


def _place(pose: Pose | None) -> tuple[str, str, str]:
    if pose is None:
        return "", "", ""
    return (
        f"{pose.latitude_deg:.7f}",
        f"{pose.longitude_deg:.7f}",
        f"{pose.altitude_amsl_m:.1f}" if math.isfinite(pose.altitude_amsl_m) else "",
    )
