"""Compose the report's sentences and tables, shared by HTML and PDF."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavrt.analysis.estimates.position_words import (
    FactTable,
    Row,
    basis_in_words,
    place_in_words,
    radii_in_words,
    remarks_of,
)
from uavrt.analysis.survey import Survey
from uavrt.analysis.whole_flights.verdict_words import verdict_facts
from uavrt.config.tags.tag_corrections import shared_offset_in_words
from uavrt.core.clock import utc_text
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import STATION_COUNTER, Pulse, SearchReport, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, counted, wrap_degrees_360
from uavrt.localization.results import Position

Table = tuple[list[str], list[list[str]]]
_POINTS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")

HINDSIGHT_METHOD = (
    "After the flight. `uavrt integrate` combined all pulses of the flight. A tag counts as "
    "found if noise alone gives such a result in at most one of 100 flights, or in the share "
    "that was set. Its pulses are shown as rings in the plots, and as *integrated* in "
    "exports. They are not used for the bearings and positions of this report, but listed "
    "separately."
)
METHODS = (
    "Pulses. A detector for each tag sums K pulses at the listed interval and reports sums "
    "above a threshold, which is set for the listed false-alarm probability. SNR is the "
    "energy of a pulse over the noise power density.",
    "Poses. Attitude and position from the autopilot are interpolated at the centre of each "
    "pulse and corrected for the antenna's mounting. Headings are clockwise from true north.",
    "Bearings. The powers of one turn in place are compared with the antenna pattern "
    "{antenna}, for an unknown level and log-normal fading; a missed pulse counts as below "
    "the threshold. The report gives mean and standard deviation of the main lobe of the "
    "probability, and the arc that contains 90 % of it [1]. A bearing is dashed if there is "
    "no clear direction, another lobe has more than 5 %, or a reflection is likely.",
    "Positions. The bearings' probabilities are multiplied over the ground; each bearing may "
    "be an outlier. The star is the most probable position, and the line around it contains "
    "the tag with 95 % probability. Lenth [2] stated the problem in this form; his estimators "
    "are in `uavrt localize`.",
)
CODED_METHOD = (
    "Coded tags. A pulse of a coded tag in this report is a whole burst. Its pulses are "
    "detected together, at the gaps of the code, in one burst or summed over several. The SNR "
    "is the mean over the pulses of the burst. Received gaps are medians; an error of the "
    "tag's crystal stretches all gaps by the same factor."
)
POWER_METHOD = (
    "Positions. They are estimated from signal strength along the flight. The upright "
    "monopole receives nothing from straight below. Level, path loss exponent, and size and "
    "duration of the fading are unknown and integrated out; expected pulses that were not "
    "received count as weak. The star is the mean of the probability. The strongest signal is "
    "not at the tag: at a height h and an exponent of 2.5 it is 0.9 h away."
)
SOURCES = (
    "[1] M. W. Shafer, G. Vega, K. Rothfus, P. Flikkema: UAV wildlife radiotelemetry: System "
    "and methods of localization. Methods in Ecology and Evolution 10 (2019). The estimator "
    "there (principal components) is replaced by a likelihood.",
    "[2] R. V. Lenth: On finding the source of a signal. Technometrics 23 (1981), 149–154.",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Position of one tag in words, for a person who will walk to it."""

    tag_id: int
    title: str
    place: str | None
    facts: FactTable


def heading_line(survey: Survey) -> str:
    """Line that states a flight's start, duration, number of tags and pulses, and antenna."""
    span = survey.span_ns
    if span is None:
        return "Empty recording."
    minutes = (span[1] - span[0]) / 60e9
    heard = len({one.pulse.tag_id for one in survey.pulse_poses})
    local = survey.facts.local_time(span[0])
    local_text = "" if local is None else f" ({local})"
    return (
        f"{utc_text(span[0])}{local_text}, {minutes:.1f} minutes · "
        f"{heard} of {counted(len(survey.tag_ids), 'tag')} received, "
        f"{counted(len(survey.pulse_poses), 'pulse')} · antenna {survey.antenna}"
    )


def findings(survey: Survey) -> list[Finding]:
    """Position of each tag in words, by tag id, with results of whole-flight analysis."""
    return [_finding(survey, tag_id) for tag_id in survey.tag_ids]


def hindsight(survey: Survey, tag_id: int) -> FactTable:
    """Table of the whole-flight result for a tag; empty if the analysis was not run."""
    verdict = survey.verdict_of(tag_id)
    return FactTable() if verdict is None else verdict_facts(verdict)


def tag_table(survey: Survey) -> Table:
    """Table of all tags with frequencies, pulses, SNR, last detection and bearings."""
    header = [
        *("Tag", "Listed MHz", "Heard MHz", "Pulses", "Confirmed", "SNR median / best"),
        *(f"Last detected {zones(survey)}", "Bearings"),
    ]
    rows = []
    for tag_id in survey.tag_ids:
        tag, own = survey.tag(tag_id), survey.pulses_of(tag_id)
        snr = [one.pulse.snr_db for one in own if math.isfinite(one.pulse.snr_db)]
        heard = [one.pulse.frequency_hz for one in own if math.isfinite(one.pulse.frequency_hz)]
        rows.append(
            [
                title_of(survey, tag_id),
                "–" if tag is None else f"{tag.frequency_hz / 1e6:.4f}",
                f"{np.median(heard) / 1e6:.4f}" if heard else "–",
                str(len(own)),
                str(sum(one.pulse.confirmed for one in own)),
                f"{np.median(snr):.0f} / {max(snr):.0f} dB" if snr else "–",
                survey.facts.clock(own[-1].pulse.start_time_ns) if own else "never",
                str(len(survey.bearings_of(tag_id))),
            ]
        )
    return header, rows


def code_table(survey: Survey) -> Table | None:
    """Table that compares listed and received codes; None if no tag is coded."""
    rows = []
    for tag_id in survey.tag_ids:
        tag = survey.tag(tag_id)
        if tag is not None and tag.coded:
            bursts = [one.pulse for one in survey.pulses_of(tag_id)]
            rows.append([title_of(survey, tag_id), *_gaps(tag, bursts)])
    return (
        (["Tag", "Listed gaps ms", "Received gaps ms", "Whole bursts"], rows) if rows else None
    )


def _gaps(tag: Tag, bursts: Sequence[Pulse]) -> tuple[str, str, str]:
    """Row of a coded tag: listed gaps, medians of received gaps, and number of bursts."""
    heard = [
        np.diff(one.burst_starts_ns) / 1e6
        for one in bursts
        if len(one.burst_starts_ns) == len(tag.gaps_s) + 1
    ]
    listed = " ".join(f"{1e3 * gap_s:.1f}" for gap_s in tag.gaps_s)
    if not heard:
        return listed, "–", "0"
    medians = " ".join(f"{gap:.1f}" for gap in np.median(heard, axis=0).tolist())
    return listed, medians, str(len(heard))


def bearing_table(survey: Survey) -> Table:
    """Table of all bearings with time, origin, 90 % interval, number of pulses and remarks."""
    time = f"Time {zones(survey)}"
    header = ["Tag", time, "From", "Bearing", "90 % within", "Pulses", "Verdict"]
    rows = []
    for one in survey.bearings:
        interval = one.bearing.interval90_deg
        rows.append(
            [
                str(one.tag_id),
                survey.facts.clock(one.start_time_ns),
                f"{one.latitude_deg:.5f}, {one.longitude_deg:.5f}",
                f"{one.bearing.bearing_deg:.0f}°",
                "–" if interval is None else f"{interval[0]:.0f}° to {interval[1]:.0f}°",
                str(one.bearing.pulses),
                "; ".join(one.bearing.remarks) or "clear",
            ]
        )
    return header, rows


def health_table(survey: Survey) -> Table:
    """Table of the processes with last status, share of time without faults, and counters."""
    header = ["Process", "Last status", "Without faults", "Counters"]
    rows = []
    for process in sorted({one.process for one in survey.health}):
        own = [one for one in survey.health if one.process == process]
        counters = {
            name: n
            for name, n in own[-1].counters.items()
            if n and not name.endswith("_ns") and not name.startswith(STATION_COUNTER)
        }
        text = ", ".join(
            f"{name.replace('_', ' ')} {_plain(n)}" for name, n in counters.items()
        )
        share = sum(one.ok for one in own) / len(own)
        rows.append([process, own[-1].status, f"{100 * share:.0f} % of the time", text or "–"])
    return header, rows


def _plain(count: float) -> str:
    """Format a whole number in full, and any other with four significant digits."""
    return f"{count:,.0f}" if count == round(count) else f"{count:.4g}"


def events(survey: Survey) -> list[list[str]]:
    """Times and texts of all notes, and of messages with severity warning or higher."""
    found = [(time_ns, text) for time_ns, text in survey.notes]
    found += [(time_ns, one.text) for time_ns, one in survey.status_texts if one.severity <= 4]
    return [[survey.facts.clock(time_ns), text] for time_ns, text in sorted(found)]


def beep_table(survey: Survey) -> Table | None:
    """Table of received signals that differ from the tag list; None if there are none."""
    rows = [
        [
            survey.facts.clock(one.time_ns),
            f"{one.frequency_hz / 1e6:.6f}",
            f"{1e3 * one.interval_s:.0f}",
            f"{one.pulses}",
            f"{one.level_db:.0f}",
            one.meaning,
        ]
        for one in survey.beeps
        if one.odd
    ]
    rows += [[*[""] * 5, line] for line in shared_offset_in_words(survey.beeps)]
    names = [f"Until {zones(survey)}", "MHz", "Every, ms", "Pulses", "dB", "What it may be"]
    return (names, rows) if rows else None


def methods(survey: Survey) -> list[str]:
    """Sentences on the estimation methods used."""
    hindsight = [HINDSIGHT_METHOD] if survey.verdicts else []
    tags = [tag for tag in map(survey.tag, survey.tag_ids) if tag is not None]
    if any(tag.coded for tag in tags):
        hindsight = [CODED_METHOD, *hindsight]
    if survey.signals:
        return [*METHODS[:2], POWER_METHOD, *hindsight]
    return [*(text.format(antenna=survey.antenna) for text in METHODS), *hindsight]


def title_of(survey: Survey, tag_id: int) -> str:
    """Heading for a tag: its number and name."""
    return f"{tag_id} {survey.name_of(tag_id)}".rstrip()


def zones(survey: Survey) -> str:
    """Names of the time zones in which tables show times, for a column heading."""
    return survey.facts.zones((survey.span_ns or (0, 0))[0])


def _finding(survey: Survey, tag_id: int) -> Finding:
    position, later = survey.placed(tag_id), hindsight(survey, tag_id)
    if position is None:
        facts, place = _without_position(survey, tag_id), None
    else:
        facts = _with_position(survey, tag_id, position)
        place = place_in_words(position)
    return Finding(
        tag_id=tag_id,
        title=f"Tag {title_of(survey, tag_id)}",
        place=place,
        facts=FactTable(
            rows=(*facts.rows, *later.rows), details=(*facts.details, *later.details)
        ),
    )


def _with_position(survey: Survey, tag_id: int, position: Position) -> FactTable:
    within = []
    if position.radius50_m is not None and position.radius95_m is not None:
        within = [radii_in_words(position.radius50_m, position.radius95_m)]
    time_ns, signal = survey.position_time_ns(tag_id), survey.signal_of(tag_id)
    loudest = None if signal is None else signal.strongest
    strongest = [] if loudest is None else [place_in_words(loudest)]
    return FactTable(
        rows=(
            ("Within", within),
            ("From the start", _from_start(survey, position)),
            ("Time", [] if time_ns is None else [survey.facts.clock_in_words(time_ns)]),
            ("Based on", [basis_in_words(position)]),
            ("Caution", [*_cautions(survey, tag_id, position), *remarks_of(position)]),
            ("Dotted track", _way(survey, position)),
        ),
        details=(("Strongest signal", strongest),),
    )


def _from_start(survey: Survey, position: Position) -> list[str]:
    """Distance and direction of a tag from the track's start, to walk there."""
    if not survey.track:
        return []
    start = survey.track[0]
    plane = TangentPlane(latitude_deg=start.latitude_deg, longitude_deg=start.longitude_deg)
    east, north = map(float, plane.to_local(position.latitude_deg, position.longitude_deg))
    direction = wrap_degrees_360(math.degrees(math.atan2(east, north)))
    return [f"{math.hypot(east, north):.0f} m {_POINTS[round(direction / 45.0) % 8]}"]


def _way(survey: Survey, position: Position) -> list[str]:
    if len(position.track) < 2:
        return []
    return [
        f"{survey.facts.clock_in_words(one.time_ns)}: {place_in_words(one)}, "
        f"within {one.radius95_m:.0f} m (95 %)"
        for one in (position.track[0], position.track[len(position.track) // 2])
    ]


def _cautions(survey: Survey, tag_id: int, position: Position) -> list[str]:
    bearings = survey.bearings_of(tag_id)
    doubts = Counter(text for one in bearings for text in one.bearing.remarks)
    many = counted(len(bearings), "bearing")
    cautions = [f"in {count} of its {many} {text}" for text, count in doubts.items()]
    if position.at_edge:
        cautions.append("it may be farther out")
    if position.stations == 1:
        cautions.append("one bearing gives the direction but hardly the distance")
    return cautions


def _without_position(survey: Survey, tag_id: int) -> FactTable:
    own = survey.pulses_of(tag_id)
    if not own:
        return _undetected([one for one in survey.search_reports if one.tag_id == tag_id])
    found = survey.position_of(tag_id)
    if found is not None and found.reason:
        reason = found.reason
    elif all(one.pose is None for one in own):
        reason = "it was not detected at any known position"
    else:
        reason = "there is no turn in place for a bearing"
    return FactTable(rows=(("Detected", [f"{len(own)} times"]), ("No position", [reason])))


def _undetected(reports: Sequence[SearchReport]) -> FactTable:
    """Rows for an undetected tag: search duration and weakest detectable pulses."""
    if not reports:
        return FactTable(rows=(("Detected", ["no"]),))
    seconds = (reports[-1].time_ns - reports[0].time_ns) / NANOSECONDS_PER_SECOND
    usable = [one.usable_share for one in reports if one.usable_share is not None]
    weakest = [one.weakest_enr_db for one in reports if one.weakest_enr_db is not None]
    scores = [one.best_score for one in reports if math.isfinite(one.best_score)]
    rows: list[Row] = [("Detected", [f"no, in {seconds:.0f} s of search"])]
    details: list[Row] = [
        ("Strongest trace", [f"{100 * max(scores, default=0.0):.0f} % of the threshold"])
    ]
    if usable and weakest:
        rows.append(("Detectable from", [f"{np.mean(weakest):.1f} dB"]))
        details.append(("Frequency usable", [f"{100.0 * np.mean(usable):.0f} % of the time"]))
    return FactTable(rows=tuple(rows), details=tuple(details))
