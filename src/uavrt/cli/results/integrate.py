"""``uavrt integrate``: find tags below the noise in the pulses of a whole flight."""

# isort: off
from uavrt.cli.shown.notices import notice, warn
from uavrt.core.messages import WHOLE_FLIGHT_FALSE_ALARM
from uavrt.cli.options.elevation_option import elevation_of
from uavrt.cli.options.kinds import (
    Between,
    Degrees,
    Hertz,
    Power,
    SecondsApart,
    TagIds,
    Vehicle,
)
from uavrt.cli.options.inputs import NOTHING_STATED, Stated, chosen_tags
from uavrt.cli.options.near_codes import warn_of_near_codes
from uavrt.cli.shown.progress_bars import progress_bar, progress_bars
from uavrt.cli.shown.outputs import make_directory, print_json
import uavrt.cli.shown.one_thread  # noqa: F401  before numpy

# isort: on
import sys
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from uavrt.core.errors import ConfigError, FormatError, RecordingError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from uavrt.analysis.covered.silence import SilentMap
    from uavrt.analysis.integrated.integrated_records import SilenceRecord
    from uavrt.analysis.whole_flights.judged_flights import IntegratedTag, WholeFlightOptions
    from uavrt.core.messages import Tag
    from uavrt.flight.reading.flight_reader import Flight


def integrate(
    flight: Path | None = None,
    *others: Path,
    recording: Path | None = None,
    track: Path | None = None,
    clock_offset: SecondsApart | None = None,
    vehicle: Vehicle | None = None,
    yaw_offset: Degrees = 0.0,
    tags: Path | None = None,
    tag: TagIds = (),
    antenna: str | None = None,
    frequency_window: Hertz = 500.0,
    false_alarm: Annotated[
        float, Parameter(validator=Between(above=0, most=0.5))
    ] = WHOLE_FLIGHT_FALSE_ALARM,
    drift: Annotated[float, Parameter(validator=Between(least=0, most=0.05))] = 0.0,
    dem: Path | None = None,
    sea: Annotated[bool, Parameter(negative="")] = False,
    stated: Stated = NOTHING_STATED,
    moves: Annotated[bool, Parameter(negative="")] = False,
    tag_power: Power = -25.0,
    plot: Path | None = None,
    save: bool = True,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Find tags below the noise: all pulses of a flight are evaluated together.

    Interval, phase, frequency and position are searched together; each pulse is weighted by
    the antenna's direction and the distance. This finds tags about 4 dB weaker than groups of
    10 to 40 pulses do. Several flights are searched separately and together, each with half
    of the false-alarm probability. Exits with 1 when no tag is found.

    Parameters
    ----------
    flight
        The flight directory: its poses, and its tags unless --tags names others. Without one,
        --recording, --track and --tags describe a flight that another program recorded.
    others
        Further flights of the same tags: together they show tags too weak for a single flight.
    recording
        Samples recorded in that flight: of the band or of a channel, in any format of uavrt
        detect. By default the channels that the flight recorded (iq/channels), or its recording
        of the band.
    track
        The drone's path while --recording was made: PX4's .ulg, ArduPilot's .BIN or .tlog, NMEA
        sentences, GPX, or a telemetry.csv of uavrt simulate. Nothing is saved.
    clock_offset
        Seconds by which the recording's clock is ahead of the track's; 0 by default.
    vehicle
        MAVLink system id of the drone with the receiver, if the .tlog of --track contains
        several drones.
    yaw_offset
        Antenna's boresight clockwise from the vehicle's nose, degrees, with --track; a flight
        has its own.
    tags
        Tag file; by default the flight's tags.
    tag
        Only these tags, by their ids.
    antenna
        Name of the antenna's pattern, or a CSV file of angles and gains. By default what the
        drone was set up with (bearings.antenna).
    frequency_window
        Half-width of the search around each tag's nominal frequency, in hertz.
    false_alarm
        Probability that noise alone is taken for a tag, for each tag in a whole flight.
    drift
        Largest relative change of a tag's interval over the flight, up or down: 0.01 is 1 %.
        Takes longer, and costs some tenths of a decibel.
    dem
        Elevation file (SRTM .hgt or GeoTIFF) or a folder of them: hills weaken pulses, and
        explain silence. Without it the ground is taken as level.
    sea
        Treat ground that no elevation file covers as water at height 0.
    moves
        With several flights: the tag may be at another place in each. By default it stays at
        one.
    tag_power
        Power that the tags radiate [dBm], antenna and animal included; collars: -30 to -10. For
        tags that are not found, the map of uavrt coverage for that power shows where they are
        not.
    plot
        Directory for a picture of each tag: the flight folded at the interval found; and for
        the maps of where tags are not. Needs the extra uavrt[analysis].
    save
        Write the results into the flight's folder (integrated/) for report and export, which
        mark these pulses, and the maps of where tags are not; the flight's own log is never
        changed.
    as_json
        Print a list of objects, with the times of all pulses.
    """
    from uavrt.analysis.measure.tag_source import read_tag_source
    from uavrt.analysis.whole_flights.judged_flights import WholeFlightOptions
    from uavrt.localization.antenna import pattern_named

    if others and recording is not None:
        raise ConfigError(
            "--recording gives the samples of one flight, but several flights are named",
            remedy="Leave --recording out; the samples of each flight are then used",
        )
    if moves and not others:
        raise ConfigError(
            "--moves needs several flights", remedy="Name further flights, or leave --moves out"
        )
    listed = read_tag_source(tags).tags if tags else None
    warn_of_near_codes(listed or (), frequency_window)
    opened = stated.options()
    if track is None:
        if clock_offset is not None or vehicle is not None or yaw_offset:
            raise ConfigError(
                "--clock-offset, --vehicle and --yaw-offset need --track",
                remedy="Leave them out, or name the track with --track",
            )
        flown = _flights(flight, others)
        remarks: tuple[str, ...] = ()
    else:
        flown, remarks = _tracked(
            *(track, flight, recording, listed),
            clock_offset=clock_offset,
            vehicle=vehicle,
            yaw_offset=yaw_offset,
        )
    if plot is not None:
        make_directory(plot, "--plot")
    named, assumed = _antenna(flown, antenna)
    asked = _Options(
        recording=recording,
        opened=opened,
        remarks=remarks,
        how=WholeFlightOptions(
            pattern=pattern_named(named),
            frequency_window_hz=frequency_window,
            false_alarm_probability=false_alarm,
            most_drift=drift,
            antenna_assumed=assumed,
            elevation=elevation_of(dem, sea=sea),
        ),
        moves=moves,
        tag_power_dbm=tag_power,
        plot=plot,
        save=save and track is None,
    )
    if others:
        found, results = _together(asked, flown, listed, tag)
    else:
        wanted = chosen_tags(listed or flown[0].info.tags, tag)
        found, results = _one_flight(asked, flown[0], wanted)
    if as_json:
        print_json([one for one, _ in results], indent=2)
    else:
        for _, text in results:
            print(text)
    if not found:
        sys.exit(1)


def _flights(first: Path | None, others: tuple[Path, ...]) -> "list[Flight]":
    from uavrt.flight.reading.flight_reader import read_flight

    if first is None:
        raise ConfigError(
            "no flight was given",
            remedy="Name the directory of a flight, or a recording of another program "
            "with --recording, --track and --tags",
        )
    for one in (first, *others):
        if one.is_file():
            raise ConfigError(
                f"{one} is not the directory of a flight",
                remedy="For a recording of another program, give --recording FILE --track "
                "FILE --tags FILE",
            )
    return [read_flight(one) for one in (first, *others)]


def _tracked(
    track: Path,
    flight: Path | None,
    recording: Path | None,
    listed: "Sequence[Tag] | None",
    *,
    clock_offset: float | None,
    vehicle: int | None,
    yaw_offset: float,
) -> "tuple[list[Flight], tuple[str, ...]]":
    """Create a flight from a recording and a track; also returns notes on missing data."""
    from uavrt.analysis.tracks.foreign_flight import flight_of_track
    from uavrt.analysis.tracks.recognised import read_track

    if flight is not None:
        raise ConfigError(
            f"--track cannot be used with {flight}, which has its own poses",
            remedy="Leave out --track, or the flight",
        )
    if recording is None or listed is None:
        missing = "--recording" if recording is None else "--tags"
        raise ConfigError(
            f"--track needs {missing}",
            remedy="Name the samples, the track and the tags: --recording FILE --track FILE "
            "--tags FILE",
        )
    way = read_track(track, vehicle)
    flown = flight_of_track(
        way, listed, name=str(track), offset_s=clock_offset or 0.0, yaw_offset_deg=yaw_offset
    )
    agree = "the clocks of recording and track are taken to agree (--clock-offset)"
    return [flown], (*way.warnings, *([agree] if clock_offset is None else []))


def _antenna(flown: "list[Flight]", asked: str | None) -> tuple[str, bool]:
    """Name of the antenna pattern for all flights, and whether it was assumed."""
    from uavrt.analysis.inputs.flown_with import antenna_is_recorded, flight_antenna
    from uavrt.analysis.measure.antenna_files import antenna_named

    if asked is not None:
        return antenna_named(asked), False
    own = sorted({flight_antenna(one) for one in flown})
    if len(own) > 1:
        raise ConfigError(
            f"the flights had different antennas: {', '.join(own)}",
            remedy="Give only flights with one antenna, or name one --antenna for all",
        )
    return own[0], not all(map(antenna_is_recorded, flown))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Options:
    recording: Path | None
    opened: dict[str, Any]
    remarks: tuple[str, ...]
    how: "WholeFlightOptions"
    moves: bool
    tag_power_dbm: float
    plot: Path | None
    save: bool


_Results = list[tuple[dict[str, Any], str]]
"""JSON record and printed sentence for each tag searched."""


def _one_flight(
    asked: _Options, flight: "Flight", wanted: "list[Tag]"
) -> tuple[bool, _Results]:
    """Search one flight; return True if any tag was found, and the results."""
    from uavrt.cli.results.integrated_words import record, sentence

    with progress_bars() as add_bar:
        how = replace(
            asked.how,
            on_progress=add_bar("reading the samples"),
            on_tag=add_bar("searching for tags", len(wanted)),
        )
        results = _judged(asked, flight, wanted, how)
    silent = _silent(asked, flight, results)
    files = _keep(asked, flight, results, silent, asked.plot)
    reported = []
    for one in results:
        own = silent.get(one.tag.tag_id)
        reported.append((record(one, _silence(own, files)), sentence(one, own)))
    return any(one.found for one in results), reported


def _together(
    asked: _Options,
    flights: "list[Flight]",
    listed: "Sequence[Tag] | None",
    ids: tuple[int, ...],
) -> tuple[bool, _Results]:
    """Search several flights together, one tag at a time to save memory.

    Returns True if any tag was found, and the results.
    """
    from uavrt.analysis.whole_flights.several_flights import (
        common_tags,
        judge_together,
        share_alone,
    )
    from uavrt.cli.results.integrated_words import record_of_flights, sentence_of_flights

    shared = common_tags(flights, listed)
    wanted = chosen_tags(shared, ids)
    found, reported = False, []
    with progress_bars() as add_bar:
        how = replace(
            asked.how,
            false_alarm_probability=share_alone(
                asked.how.false_alarm_probability, len(flights)
            ),
            on_progress=add_bar("reading the samples"),
        )
        on_tag = add_bar("searching for tags", len(wanted) * len(flights))
        for number, tag in enumerate(wanted):
            each = []
            for flight in flights:
                each += _judged(asked, flight, [tag], how)
                on_tag(number * len(flights) + len(each))
            one = judge_together(
                flights,
                each,
                asked.how.pattern,
                false_alarm_probability=asked.how.false_alarm_probability,
                moves=asked.moves,
                elevation=asked.how.elevation,
            )
            maps, records = [], []
            for flight, own in zip(flights, one.flights, strict=True):
                name = Path(flight.info.directory).resolve().name
                # What is found in all together is silent in none.
                silent = {} if one.found else _silent(asked, flight, [own])
                plot = None if asked.plot is None else asked.plot / name
                files = _keep(asked, flight, [own], silent, plot)
                maps.append(silent.get(tag.tag_id))
                records.append(_silence(maps[-1], files))
            found |= one.found
            reported.append((record_of_flights(one, records), sentence_of_flights(one, maps)))
    return found, reported


def _judged(
    asked: _Options, flight: "Flight", wanted: "list[Tag]", how: "WholeFlightOptions"
) -> "list[IntegratedTag]":
    from uavrt.analysis.whole_flights.judged_flights import integrate_flight
    from uavrt.analysis.whole_flights.kept_samples import integrate_kept
    from uavrt.radio.opening import open_recording

    path = asked.recording or _band_recording(Path(flight.info.directory), wanted)
    if path is None:
        _check_unused_options(asked.opened)
        return integrate_kept(flight, wanted, how)
    with closing(open_recording(path, **asked.opened)) as source:
        found = integrate_flight(flight, source, wanted, how)
    return [replace(one, limitations=(*one.limitations, *asked.remarks)) for one in found]


def _check_unused_options(opened: dict[str, Any]) -> None:
    """Raise `ConfigError` for options that have no effect with the flight's own channels."""
    options = {
        "format_name": "--format",
        "sample_rate_hz": "--sample-rate",
        "center_frequency_hz": "--center-frequency",
        "start_time_ns": "--start-time",
    }
    for name, option in options.items():
        if opened[name] is not None:
            raise ConfigError(
                f"{option} applies only to --recording; the channels recorded in a "
                "flight contain this value",
                remedy=f"Leave {option} out, or name the recording",
            )


def _silent(
    asked: _Options, flight: "Flight", results: "list[IntegratedTag]"
) -> "dict[int, SilentMap]":
    """Map of where each tag not found would have been detected, by tag id; prints problems."""
    from uavrt.analysis.covered.silence import silent_maps
    from uavrt.analysis.integrated.hindsight import verdict_of

    try:
        with progress_bar("mapping areas without the tag") as on_pulse:
            return silent_maps(
                flight,
                [one.tag for one in results],
                [verdict_of(flight, one) for one in results],
                asked.tag_power_dbm,
                elevation=asked.how.elevation,
                on_pulse=on_pulse,
            )
    except (UsageError, RecordingError, FormatError) as error:
        warn(f"no map of areas without the tag: {error}")
        return {}


def _silence(one: "SilentMap | None", files: dict[int, list[Path]]) -> "SilenceRecord | None":
    from uavrt.analysis.integrated.integrated_records import SilenceRecord

    return None if one is None else SilenceRecord.of(one, files.get(one.tag_id, []))


def _keep(
    asked: _Options,
    flight: "Flight",
    results: "list[IntegratedTag]",
    silent: "dict[int, SilentMap]",
    plot: Path | None,
) -> dict[int, list[Path]]:
    """Write results, pictures and maps into the flight's folder, as requested; return maps."""
    from uavrt.analysis.coverage_files import write_silence
    from uavrt.analysis.integrated.fold_pictures import write_fold_pictures
    from uavrt.analysis.integrated.hindsight import save_integrated

    ids = [one.tag.tag_id for one in results]
    files: dict[int, list[Path]] = {}
    if asked.save:
        try:
            directory = save_integrated(flight, results, silent)
            with suppress(UsageError):  # without matplotlib there are no pictures
                write_fold_pictures(directory, results)
            files = write_silence(directory, flight, silent, ids)
        except (RecordingError, FormatError) as error:  # results are printed anyway
            warn(f"not saved: {error}")
    if plot is not None:
        drawn = write_fold_pictures(plot, results)
        here = write_silence(plot, flight, silent, ids)
        files = files or here
        for file in [*drawn, *(one for some in here.values() for one in some)]:
            notice(f"drawn: {file}")
    return files


def _band_recording(flight: Path, wanted: "list[Tag]") -> Path | None:
    """Find the flight's recording of the full band; None if its recorded channels suffice."""
    from uavrt.analysis.whole_flights.kept_samples import channel_of, kept_channels
    from uavrt.flight.flight_layout import FlightLayout

    found = sorted(FlightLayout(flight).iq_directory.glob("*.sigmf-meta"))
    kept = kept_channels(flight)
    if kept and (len(found) != 1 or all(channel_of(kept, one) for one in wanted)):
        return None
    if len(found) != 1:
        what = "no samples" if not found else f"{len(found)} recordings"
        raise ConfigError(
            f"{flight} contains {what}",
            remedy="Name the samples with --recording, or fetch them: uavrt fetch --samples",
        )
    return found[0]
