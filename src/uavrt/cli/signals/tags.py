"""``uavrt tags``: check a tag file, write it in the other format, measure an unknown tag."""

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from uavrt.cli.examples import examples
from uavrt.cli.options.inputs import NOTHING_STATED, Stated
from uavrt.cli.options.kinds import Count, Hertz
from uavrt.cli.shown.notices import notice, warn
from uavrt.cli.shown.outputs import check_place, keep_inputs
from uavrt.cli.shown.progress_bars import progress_bar
from uavrt.cli.system.run import DEFAULT_CONFIG, settings_from
from uavrt.core.clock import cpu_s, iso_utc
from uavrt.core.errors import ConfigError, TagFileError, UavrtError, os_errors_as
from uavrt.core.foreign import TAGS, read_file
from uavrt.core.units import counted

if TYPE_CHECKING:
    from uavrt.analysis.measure.coded_bursts import MeasuredCode
    from uavrt.analysis.measure.measured_tag import MeasuredRate, MeasuredTag
    from uavrt.analysis.measure.tag_source import TagSource
    from uavrt.core.messages import Tag
    from uavrt.radio.files.recording_source import RecordingSource

tags = App(
    name="tags", help="Check and convert tag files (TagInfo.txt, tags.toml); measure tags."
)

IN_HERTZ = "Give --center-frequency in hertz, such as 148.7e6"


@tags.command(help_epilogue=examples("tags check"))
def check(
    file: Path, *, config: Annotated[Path, Parameter(alias="-c")] = DEFAULT_CONFIG
) -> None:
    """Show the contents of a tag file, or everything that is wrong with it.

    A list that a flight could not search for is refused with the reason and the remedy.

    Parameters
    ----------
    file
        A TagInfo.txt, tags.toml, the original's detectorConfig.txt, or TagTracker's TagInfo.db
        with its TagManufacturer.db in the same folder.
    config
        The drone's settings: sample rate, radio frequency and search window.
    """
    from uavrt.config.parameters import tags_with_overrides, warnings_of_band
    from uavrt.detection.search_plan import plan_search

    found = _read(file).tags
    for tag in found:
        print(_sentence(tag))
    _warn_of_unselected(file)
    if found:
        settings = settings_from(config)
        radio, detection = settings.radio, settings.detection
        rate_hz, center_hz = radio.sample_rate_hz, radio.center_frequency_hz
        warnings = () if center_hz is None else warnings_of_band(found, center_hz, rate_hz)
        plan = plan_search(
            tags_with_overrides(settings, found),
            cpu_s,
            sample_rate_hz=rate_hz,
            detection=detection,
            center_frequency_hz=center_hz,
        )
        for warning in (*warnings, *plan.warnings):
            print(f"warning: {warning}")
        if plan.cores > detection.worker_count:
            print(
                f"warning: the search needs {plan.cores:.1f} cores of a computer like this "
                f"one, and {detection.worker_count} can be spared"
            )
    for warning in _similar_tags_warnings(found):
        print(f"warning: {warning}")
    print(f"{file}: {counted(len(found), 'tag')}, no fault")


@tags.command(help_epilogue=examples("tags convert"))
def convert(source: Path, target: Path, *, overwrite: bool = False) -> None:
    """Convert a tag file; the target's name selects the format: .toml or .txt.

    Parameters
    ----------
    source
        A TagInfo.txt, tags.toml, the original's detectorConfig.txt, or TagTracker's TagInfo.db
        with its TagManufacturer.db in the same folder.
    target
        The file to write.
    overwrite
        Replace the target if it exists.
    """
    from uavrt.config.tags.tag_files import check_tag_file_name, write_tags

    known = _read(source)
    found = known.tags
    check_place(target, overwrite=overwrite)
    check_tag_file_name(target)
    write_tags(target, found)
    named = sum(tag.name is not None for tag in found)
    print(f"{target}: {counted(len(found), 'tag')} written")
    if named and target.suffix.lower() != ".toml":
        print(f"{counted(named, 'name')} left out: TagInfo.txt has no column for names")
    if known.operating_modes:
        print(
            "Channel, operating mode and excluded ranges are left out: tag files have no "
            "fields for them"
        )
    _warn_of_unselected(source)


@tags.command(help_epilogue=examples("tags correct"))
def correct(
    file: Path,
    *flights: Path,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    intervals: bool = False,
    overwrite: bool = False,
) -> None:
    """Correct a tag list by what flights have measured; the old values are printed.

    Tags that are off their label, or have drifted by 100 Hz, are listed where they were found.
    A pulse train that may be of two listed tags, or of a mirrored one, corrects none. If all
    tags of a flight are off by the same ppm, the receiver is: the ppm are printed, and no
    frequency is corrected.

    Parameters
    ----------
    file
        The list.
    flights
        Directories of flights, received or recorded; the newest measurement of a tag counts.
    output
        The file to write; without it the corrections are only shown.
    intervals
        Also list the measured interval and jitter of tags that were found.
    overwrite
        Replace the output if it exists.
    """
    from uavrt.config.tags.tag_corrections import (
        MEASURED,
        TagCorrection,
        correction_of,
        shared_offset_in_words,
    )
    from uavrt.config.tags.tag_files import write_tags
    from uavrt.core.messages import Beep, BeepKind
    from uavrt.detection.sensitivity import gain_in_words
    from uavrt.flight.reading.flight_reader import read_beeps

    listed = {tag.tag_id: tag for tag in _read(file).tags}
    newest: dict[tuple[int, BeepKind], tuple[Beep, tuple[Beep, ...]]] = {}
    for flight in flights:
        found = read_beeps(flight)
        for line in shared_offset_in_words(found):
            print(f"{flight}: {line}")
        for beep in found:
            if beep.ambiguous:
                print(f"not corrected: {beep}")
            elif beep.kind in MEASURED and beep.tag_ids and beep.tag_ids[0] in listed:
                key = beep.tag_ids[0], beep.kind
                if key not in newest or newest[key][0].time_ns < beep.time_ns:
                    newest[key] = beep, found
    corrected = dict(listed)
    corrections: dict[tuple[int, str], TagCorrection] = {}
    placed = set[int]()

    def other_rates_last(one: tuple[Beep, tuple[Beep, ...]]) -> tuple[bool, int]:
        return one[0].kind is BeepKind.OTHER_RATE, -one[0].time_ns

    for beep, found in sorted(newest.values(), key=other_rates_last):
        tag_id = beep.tag_ids[0]
        allowed = {  # only the first, the newest one, corrects the frequency
            "frequency": tag_id not in placed,
            "interval": intervals or beep.kind is BeepKind.OTHER_RATE,
        }
        placed.add(tag_id)
        while one := correction_of(corrected[tag_id], beep, beep.time_ns, found):
            if not allowed[one.what]:
                break
            corrected[tag_id] = one.after
            corrections[tag_id, one.what] = one
    for one in corrections.values():
        before = listed[one.tag_id]
        gain = gain_in_words(before, one.after) if one.what == "interval" else ""
        print(f"{replace(one, before=before)}{gain}")
    count = len({one.tag_id for one in corrections.values()})
    if output is None:
        print(f"{counted(count, 'tag')} to correct; -o FILE writes the list")
        return
    check_place(output, overwrite=overwrite)
    write_tags(output, tuple(corrected.values()))
    print(f"{output}: {count} of {counted(len(listed), 'tag')} corrected")


def _read(path: Path) -> "TagSource":
    from uavrt.analysis.measure.tag_source import TagSource, read_tag_source
    from uavrt.config.tags.tag_files import faults_of_tags

    if path.suffix.lower() == ".db":
        return TagSource(tags=_of_tagtracker(path))
    known = read_tag_source(path)
    faults = faults_of_tags(known.tags) if known.operating_modes else []
    if faults:
        raise TagFileError(str(path), faults)
    return known


def _of_tagtracker(path: Path) -> "tuple[Tag, ...]":
    from uavrt.ground.store.tag_table import import_rows, tags_from_rows

    found, faults = tags_from_rows(import_rows(_databases(path)))
    if faults:
        raise TagFileError(str(path), [one.text for one in faults])
    return found


def _databases(path: Path) -> dict[str, str]:
    """Texts of ``TagInfo.db`` and of ``TagManufacturer.db`` in the same folder, by name."""
    files = {}
    for one in (path, path.with_name("TagManufacturer.db")):
        with os_errors_as(
            ConfigError,
            f"cannot read {one}",
            "TagTracker keeps TagInfo.db and TagManufacturer.db together",
        ):
            files[one.name] = read_file(one, TAGS).decode("utf-8-sig", "replace")
    return files


def _warn_of_unselected(path: Path) -> None:
    """Warn of tags that TagTracker's list excludes: our tag file would search for them."""
    from uavrt.ground.store.tag_table import not_selected

    left_out = not_selected(_databases(path)) if path.suffix.lower() == ".db" else None
    for number in left_out or ():
        print(
            f"warning: tag {number} is not selected in TagTracker, but a tag file searches for "
            "all of its tags: take its line out, or import on the page, which leaves it out of "
            "the flight"
        )


@tags.command(help_epilogue=examples("tags measure"))
def measure(
    recording: Path,
    *,
    frequency: Hertz | None = None,
    window: Hertz = 2000.0,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    id: Count = 2,
    name: str | None = None,
    stated: Stated = NOTHING_STATED,
    overwrite: bool = False,
) -> None:
    """Find unknown tags in a recording: frequency, pulse width, intervals, jitter, drift.

    Measurements with standard deviations go to standard error; tag entries go to the output,
    with tolerances that allow for changes in temperature and battery.

    Parameters
    ----------
    recording
        A file with about ten pulses or more of a nearby tag.
    frequency
        Approximate frequency in hertz; by default the whole band is searched.
    window
        Half-width of the search around --frequency, in hertz.
    output
        A tag file to write, .toml or .txt; by default TOML on standard output.
    id
        Id of the first tag; the others get every second id after it.
    name
        Name of the tag; several tags are numbered: Luna 1, Luna 2.
    overwrite
        Replace the output if it exists.
    """
    from uavrt.analysis.measure.measure_tag import measure_tags
    from uavrt.analysis.measure.measured_tag import MeasuredTag
    from uavrt.config.tags.tag_files import check_tag_file_name, write_tags
    from uavrt.config.tags.tag_rules import MAX_ID
    from uavrt.config.tags.tags_toml import format_tags_toml
    from uavrt.radio.opening import open_recording

    if not 1 <= id <= MAX_ID:
        raise ConfigError(
            f"{id} is not a valid number for a tag", remedy="Give an --id of 1 or more"
        )
    _check_center(stated.center_frequency)
    if output is not None:
        check_place(output, overwrite=overwrite)
        keep_inputs(output, (recording,))
        check_tag_file_name(output)
    options = stated.options()
    faults: list[UavrtError] = []

    def opened() -> "RecordingSource":
        return open_recording(recording, **options)

    with closing(opened()) as source:
        if source.origin:
            notice(source.origin)
    with progress_bar("measuring", 1.0) as on_progress, _reporting(faults):
        found = measure_tags(
            opened,
            frequency_hz=frequency,
            window_hz=window,
            on_progress=on_progress,
            on_fault=faults.append,
        )
    names = _numbered(name, len(found.tags) + len(found.codes))
    both: list[MeasuredTag | MeasuredCode] = [*found.tags, *found.codes]
    entries = [tag.entry(id + 2 * place, names[place]) for place, tag in enumerate(both)]
    for one, entry in zip(both, entries, strict=True):
        if isinstance(one, MeasuredTag):
            lines = _measured_lines(entry.tag_id, one)
        else:
            lines = _code_lines(entry.tag_id, one)
        notice("\n".join(lines))
    for doubtful in found.doubtful:
        notice(doubtful)
    with _reporting(faults):
        _check_entries(entries)
        if output is None:
            print(format_tags_toml(entries), end="")
        else:
            write_tags(output, entries)
            notice(f"{output}: {counted(len(entries), 'tag')} written")
    if faults:
        raise faults[0]


def _code_lines(tag_id: int, code: "MeasuredCode") -> list[str]:
    gaps = ", ".join(
        _with_sigma(1e3 * gap_s, 1e3 * sigma_s)
        for gap_s, sigma_s in zip(code.gaps_s, code.gaps_sigma_s, strict=True)
    )
    return [
        f"tag {tag_id}: this looks coded: {code.bursts} bursts with the same gaps",
        f"  frequency  {code.frequency_hz / 1e6:.6f} MHz",
        f"  gaps       {gaps} ms",
        "  bursts     every "
        f"{_with_sigma(1e3 * code.burst_interval_s, 1e3 * code.burst_interval_sigma_s)} ms",
    ]


def _with_sigma(number: float, sigma: float) -> str:
    """Format a number with its standard deviation, to two digits of the latter."""
    digits = 2
    while digits < 6 and round(sigma, digits) < 9.5 * 10.0**-digits:
        digits += 1
    return f"{number:.{digits}f} ± {sigma:.{digits}f}"


def _check_center(center_frequency_hz: float | None) -> None:
    """Reject megahertz typed for hertz, before the work starts."""
    from uavrt.config.tags.tag_rules import MAX_FREQUENCY_HZ, MIN_FREQUENCY_HZ

    if center_frequency_hz is not None and not (
        MIN_FREQUENCY_HZ <= center_frequency_hz <= MAX_FREQUENCY_HZ
    ):
        raise ConfigError(
            f"the center frequency {center_frequency_hz:.10g} Hz is outside the range of "
            "radio tags",
            remedy=IN_HERTZ,
        )


def _check_entries(entries: "Sequence[Tag]") -> None:
    """Reject entries that `uavrt tags check` would reject."""
    from uavrt.config.tags.tag_files import faults_of_tags

    faults = faults_of_tags(entries)
    if faults:
        raise ConfigError(
            f"the measurements do not make a valid tag file: {'; '.join(faults)}",
            remedy=f"{IN_HERTZ} if the recording states a wrong one",
        )


def _numbered(name: str | None, count: int) -> "list[str | None]":
    if name is None or count == 1:
        return [name] * count
    return [f"{name} {number}" for number in range(1, count + 1)]


@contextmanager
def _reporting(faults: list[UavrtError]) -> Iterator[None]:
    """Context that prints faults of the recording, even if another error ends the work."""
    try:
        yield
    except UavrtError:
        for fault in faults:
            warn(fault)
        raise


def _measured_lines(tag_id: int, tag: "MeasuredTag") -> list[str]:
    return [
        f"tag {tag_id}: {tag.pulses} pulses, {tag.enr_db:.1f} dB",
        f"  frequency  {tag.frequency_hz / 1e6:.6f} MHz ± {tag.frequency_sigma_hz:.1f} Hz, "
        f"drift {60.0 * tag.drift_hz_per_s:+.1f} ± {60.0 * tag.drift_sigma_hz_per_s:.1f} "
        "Hz a minute (by this radio's crystal)",
        f"  width      {1e3 * tag.pulse_width_s:.2f} ± {1e3 * tag.pulse_width_sigma_s:.2f} ms",
        *([f"  slide      {tag.slide_hz:+.0f} Hz in each pulse"] if tag.slide_hz else []),
        *(line for rate in tag.rates for line in _rate_lines(rate)),
    ]


def _rate_lines(rate: "MeasuredRate") -> list[str]:
    return [
        f"  interval   {1e3 * rate.interval_s:.3f} ± {1e3 * rate.interval_sigma_s:.3f} ms, "
        f"drift {1e6 * rate.drift:+.2f} ± {1e6 * rate.drift_sigma:.2f} ppm a pulse",
        f"    jitter   {1e3 * rate.jitter_s:.2f} ms rms, at most "
        f"{1e3 * rate.largest_deviation_s:.2f} ms",
        f"    seen     {rate.pulses} pulses, {rate.missing} missed, "
        f"{iso_utc(rate.first_time_ns)[:19]} to {iso_utc(rate.last_time_ns)[11:19]} UTC",
    ]


def _similar_tags_warnings(found: "Sequence[Tag]") -> Iterator[str]:
    """Sentences on tags of one band that may be confused, and how to separate them."""
    from uavrt.config.settings import DetectionSettings
    from uavrt.config.tags.code_rules import words_of_near_codes
    from uavrt.config.tags.tag_bands import tags_by_band
    from uavrt.detection.track.transmitters.train_senders import (
        interval_separation,
        small_ratio,
    )

    window_hz = DetectionSettings().frequency_window_hz
    yield from words_of_near_codes(found, window_hz)
    for together in tags_by_band([tag for tag in found if not tag.coded], window_hz):
        for one, two in combinations(together, 2):
            if abs(one.frequency_hz - two.frequency_hz) >= 2.0 * window_hz:
                continue
            if (ratio := small_ratio(one, two)) is not None:
                yield _at_a_ratio(one, two, ratio)
            parting = interval_separation(one, two)
            if parting.certain and parting.pulses is not None:
                continue
            gap_ms = 1e3 * parting.gap_s
            apart_hz = abs(one.frequency_hz - two.frequency_hz)
            begin = (
                f"tags {one.tag_id} and {two.tag_id} are {apart_hz:.0f} Hz and {gap_ms:.3g} ms "
                f"apart: their pulses may be reported as {one.tag_id} or {two.tag_id}"
            )
            if parting.pulses is None or parting.uncertainty_s == 0.0:
                parts = "nothing but the frequency" if apart_hz > 0.0 else "nothing"
                yield f"{begin}; tags drift by more, so {parts} distinguishes them"
                continue
            yield (
                f"{begin} if only one is received. With ± {1e3 * parting.uncertainty_s:.3g} ms "
                f"or less for each, one alone is identified after {parting.pulses} pulses "
                f"({parting.seconds:.3g} s); `uavrt tags measure` measures intervals"
            )


def _at_a_ratio(one: "Tag", two: "Tag", ratio: tuple[int, int]) -> str:
    slow, fast = one, two
    if max(one.pulse_intervals_s) < max(two.pulse_intervals_s):
        slow, fast = two, one
    more, fewer = ratio
    return (
        f"the intervals of tags {slow.tag_id} and {fast.tag_id} may have the ratio {more} to "
        f"{fewer}. When many pulses of tag {fast.tag_id} fade, the others may be reported as "
        f"tag {slow.tag_id}'s; when the pulses of both coincide, one tag hides the other. To "
        "avoid this, choose intervals further from such a ratio, or frequencies 1 kHz apart"
    )


def _sentence(tag: "Tag") -> str:
    intervals = " and ".join(f"{interval * 1000:.10g}" for interval in tag.pulse_intervals_s)
    name = "" if tag.name is None else f" {tag.name}"
    if tag.coded:
        gaps = ", ".join(f"{1e3 * gap_s:.10g}" for gap_s in tag.gaps_s)
        return (
            f"tag {tag.tag_id}{name}: {tag.frequency_hz / 1e6:.6f} MHz, coded, "
            f"{tag.pulse_width_s * 1000:.10g} ms, gaps {gaps} ms, a burst every "
            f"{tag.pulse_intervals_s[0]:.10g} s (± {tag.interval_uncertainty_s * 1000:.10g} "
            f"ms), up to {tag.k} summed"
        )
    slides_hz = tag.frequency_slide_hz
    slide = f", frequency slides by {slides_hz:+.10g} Hz in a pulse" if slides_hz else ""
    return (
        f"tag {tag.tag_id}{name}: {tag.frequency_hz / 1e6:.6f} MHz, "
        f"{tag.pulse_width_s * 1000:.10g} ms every {intervals} ms "
        f"(± {tag.interval_uncertainty_s * 1000:.10g} ms, "
        f"jitter {tag.interval_jitter_s * 1000:.10g} ms), K = {tag.k}, "
        f"false alarms {tag.false_alarm_probability * 100:.10g} %{slide}"
    )
