"""``uavrt detect``: find pulses in a recording or a live stream."""

# isort: off
from uavrt.cli.shown.notices import notice
from uavrt.cli.options.kinds import Hertz
from uavrt.cli.options.near_codes import warn_of_near_codes
import uavrt.cli.shown.one_thread  # noqa: F401  before numpy

# isort: on
import errno
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from uavrt.analysis.measure.recorded_pulses import DetectionSummary
from uavrt.analysis.measure.recorded_pulses import detect as run_detectors
from uavrt.analysis.measure.redetect import FlightWriter
from uavrt.analysis.measure.tag_source import TagSource, read_tag_source
from uavrt.cli.options.inputs import NOTHING_STATED, Stated
from uavrt.cli.shown.outputs import keep_inputs
from uavrt.cli.shown.progress_bars import progress_bar
from uavrt.config.ghost_places import Receiver
from uavrt.config.settings import DetectionSettings, OperatingModeName
from uavrt.config.tags.tag_corrections import words_of_beeps
from uavrt.core.clock import cpu_s
from uavrt.core.errors import ConfigError, RecordingError, UavrtError
from uavrt.core.messages import Beep, IQBlock, Pulse, Tag, keep_beep
from uavrt.detection.beeps.beep_search import BeepSearch
from uavrt.detection.modes import OperatingMode
from uavrt.detection.search_costs import search_cost
from uavrt.flight.logs.pulse_files import PulseWriter, pulse_format
from uavrt.flight.reading.flight_reader import Flight, read_flight
from uavrt.radio.opening import open_channel, open_recording, open_stream
from uavrt.radio.source import SampleSource
from uavrt.radio.timing.losses import most_lost
from uavrt.radio.udp_address import is_udp_address

if TYPE_CHECKING:
    from uavrt.cli.signals.pulse_listeners import Listener

Write = Callable[[Sequence[Pulse]], None]


def detect(
    recording: Annotated[str, Parameter(allow_leading_hyphen=True)],
    *,
    tags: Path | None = None,
    stated: Stated = NOTHING_STATED,
    frequency_window: Hertz = 500.0,
    mode: OperatingModeName | None = None,
    output: Annotated[
        str | None, Parameter(name=["--output", "-o"], allow_leading_hyphen=True)
    ] = None,
    flight: Path | None = None,
    plot: Path | None = None,
    udp_pulses: str | None = None,
    ros2: str | None = None,
    ros2_namespace: str = "",
) -> None:
    """Find the pulses of tags in a recording or a live stream.

    Pulses are written as they are found. Ctrl-C ends a live stream cleanly.

    Parameters
    ----------
    recording
        A file, or - for samples on standard input, as from `airspy_rx -r - -t 0`, or
        udp://127.0.0.1:20090 for one channel of the original's channelizer or ours.
    tags
        Tag file: TagInfo.txt, tags.toml, or the original's detectorConfig.txt. With --flight,
        defaults to that flight's tags.
    frequency_window
        Half-width of the search around each tag's nominal frequency, in hertz.
    mode
        What to search once a tag's frequency has been found. freqSearchSoftLock: always the
        window. freqSearchHardLock: once confirmed, ± 100 Hz around the found frequency.
        freqKnownHardLock: ± 100 Hz around the nominal frequency. freqAllNeverLock: the whole
        channel, without tracks. By default as a detectorConfig.txt says, else
        freqSearchSoftLock.
    output
        File.csv, File.jsonl, or - (JSON lines); by default -. With --flight a directory.
    flight
        Flight directory in which the recording was made: pulses get its poses, and a new flight
        directory is written.
    plot
        Directory for pictures of each tag: waterfall, pulses folded at the interval, SNR.
        Needs the extra uavrt[analysis].
    udp_pulses
        HOST:PORT to send pulses to in the original detector's format, e.g. 127.0.0.1:50000.
    ros2
        Also publish the pulses on ROS 2: network interfaces separated by commas, e.g. eth0; lo
        for this computer only. Needs the extra uavrt[ros2].
    ros2_namespace
        Namespace of the drone that takes the pulses, as in its [ros2] namespace.
    """
    flown = None if flight is None else read_flight(flight)
    known = _with_mode(_tags(tags, flown), mode)
    if is_udp_address(recording):
        stated = replace(
            stated,
            sample_rate=stated.sample_rate or known.sample_rate_hz,
            center_frequency=stated.center_frequency or known.center_frequency_hz,
        )
    options = stated.options()
    with ExitStack() as stack:
        source = stack.enter_context(closing(open_source(recording, options)))
        if origin := getattr(source, "origin", ""):
            notice(origin)
        wanted = _tags_in_band(known, source)
        listeners = _listeners(stack, wanted, plot, udp_pulses, frequency_window)
        if ros2 is not None:
            from uavrt.cli.signals.pulse_listeners import RosPulses  # 4 MB

            named = RosPulses(ros2, wanted, ros2_namespace)
            listeners.append(stack.enter_context(closing(named)))
        live = source.total_samples is None
        receiver = Receiver(source.center_frequency_hz, source.sample_rate_hz)
        known_beeps: list[Beep] = []
        beeps = BeepSearch(wanted, frequency_window, receiver, live=live)

        def on_band(block: IQBlock, band: IQBlock) -> None:
            beeps.add(block, band)
            if live:
                news = beeps.news(block.time_ns)
                _name([one for one in news if keep_beep(known_beeps, one)])

        searched = _searched(known, frequency_window)
        _warn_of_cost(wanted, searched, live=live)
        writer = None
        if flown is None:
            keep_inputs(output or "-", (recording, tags))
            coded = any(tag.coded for tag in wanted)
            write = stack.enter_context(_pulse_output(output or "-", bursts=coded))
        else:
            directory = None if output in (None, "-") else Path(str(output))
            writer = stack.enter_context(
                closing(FlightWriter(flown, source, wanted, directory, searched))
            )
            write = writer.write
        write = _to_all(write, listeners)
        should_stop = stack.enter_context(stop_on_signals())
        summary = DetectionSummary()
        stack.enter_context(_finishing(listeners, summary))
        try:
            total = source.total_samples
            with nullcontext() if total is None else progress_bar("detecting", total) as shown:
                run_detectors(
                    source,
                    wanted,
                    write,
                    frequency_window_hz=frequency_window,
                    operating_modes=known.operating_modes,
                    excluded_hz=known.excluded_hz,
                    on_channel=_call_each(listeners, "channel"),
                    on_band=on_band,
                    on_reports=_call_each(listeners, "reports"),
                    should_stop=lambda: should_stop() is not None,
                    on_progress=shown,
                    summary=summary,
                )
        except UavrtError:
            if writer is not None and not summary.samples:
                writer.discard()
                writer = None
            raise
        finally:
            _report(summary, wanted, writer, source)
            _name(beeps.finish())
        number = should_stop()
    if number is not None:
        sys.exit(128 + number)


def _tags_in_band(known: TagSource, source: SampleSource) -> tuple[Tag, ...]:
    """Select the tags within the received band, and print those outside it."""
    inside = known.within(source.sample_rate_hz, source.center_frequency_hz).tags
    for tag in known.tags:
        if tag not in inside:
            notice(
                f"tag {tag.tag_id} at {tag.frequency_hz / 1e6:.6f} MHz is outside of this "
                "recording's band and is not searched"
            )
    return inside


def _name(beeps: Sequence[Beep]) -> None:
    for line in words_of_beeps(beeps):
        notice(line)


def _warn_of_cost(tags: Sequence[Tag], settings: DetectionSettings, *, live: bool) -> None:
    """Warn if a search needs more than one core.

    A `live` stream then loses samples, and a recording takes long.
    """
    warn_of_near_codes(tags, settings.frequency_window_hz)
    cores = search_cost(tags, cpu_s, settings=settings)
    if cores <= 1.0:
        return
    effect = (
        "a live stream will fall behind and lose samples"
        if live
        else f"it takes about {cores:.1f} times as long as the recording"
    )
    notice(
        f"the search for these {len(tags)} tags needs {cores:.1f} of this computer's cores, "
        f"and one is used: {effect}. Fewer tags, a smaller K or a narrower interval "
        "uncertainty cost less"
    )


def _tags(path: Path | None, flown: Flight | None) -> TagSource:
    if path is not None:
        return read_tag_source(path)
    if flown is not None:
        return TagSource(tags=flown.info.tags)
    raise ConfigError(
        "there are no tags to search for", remedy="Give --tags TagInfo.txt or tags.toml"
    )


def _with_mode(known: TagSource, mode: OperatingModeName | None) -> TagSource:
    if mode is None:
        return known
    modes = {tag.tag_id: OperatingMode(mode) for tag in known.tags}
    return replace(known, operating_modes=modes)


def _searched(known: TagSource, frequency_window_hz: float) -> DetectionSettings:
    """Create detection settings from the search window and the tag file's operating mode."""
    settings = DetectionSettings(frequency_window_hz=frequency_window_hz)
    for mode in known.operating_modes.values():
        settings = replace(settings, operating_mode=mode.value)
    return settings


def _listeners(
    stack: ExitStack,
    tags: Sequence[Tag],
    plot: Path | None,
    udp_pulses: str | None,
    frequency_window_hz: float,
) -> "list[Listener]":
    """Create additional receivers of results, so that errors appear before the work starts."""
    if plot is None and udp_pulses is None:
        return []
    from uavrt.cli.signals.pulse_listeners import Plots, PulseDatagrams  # 4 MB

    found: list[Listener] = []
    if plot is not None:
        found.append(Plots(plot, tags, frequency_window_hz))
    if udp_pulses is not None:
        found.append(stack.enter_context(closing(PulseDatagrams(udp_pulses, tags))))
    return found


def _to_all(write: Write, listeners: "Sequence[Listener]") -> Write:
    def write_and_notify(pulses: Sequence[Pulse]) -> None:
        write(pulses)
        for listener in listeners:
            listener.pulses(pulses)

    return write_and_notify


@contextmanager
def _finishing(listeners: "Sequence[Listener]", summary: DetectionSummary) -> Iterator[None]:
    """Context that calls `finish` of all receivers at its end, even after an error."""
    try:
        yield
    except UavrtError:
        if summary.samples:
            with suppress(UavrtError):
                _finish(listeners)
        raise
    _finish(listeners)


def _finish(listeners: "Sequence[Listener]") -> None:
    for listener in listeners:
        listener.finish()


def _call_each(listeners: "Sequence[Listener]", name: str) -> Callable[[Any], None] | None:
    """Function that calls a method on all receivers; None if there are none."""
    methods: list[Callable[[Any], None]] = [getattr(one, name) for one in listeners]

    def call_each(argument: Any) -> None:
        for method in methods:
            method(argument)

    return call_each if methods else None


def open_source(recording: str, options: dict[str, Any]) -> SampleSource:
    """Open a UDP port, standard input or a recording; `options`: as for `open_recording`."""
    if is_udp_address(recording):
        of_channel = ("sample_rate_hz", "center_frequency_hz")
        return open_channel(recording, **{name: options[name] for name in of_channel})
    if recording != "-":
        return open_recording(Path(recording), **options)
    if sys.stdin is None or sys.stdin.isatty():
        raise ConfigError(
            "standard input is the keyboard, but samples are expected",
            remedy="Pipe a radio's program into it: airspy_rx … -r - | uavrt detect - …",
        )
    return open_stream(sys.stdin.fileno(), **options)


@contextmanager
def _pulse_output(name: str, *, bursts: bool) -> Iterator[Write]:
    """Open the output file, - for stdout, before the work starts; yield its write function."""
    if Path(name).suffix.lower() in (".xls", ".xlsx", ".ods"):
        raise ConfigError(
            f"{name}: uavrt does not write spreadsheet files",
            remedy="Choose a name that ends in .csv; every spreadsheet program opens "
            "such a file",
        )
    with _naming_faults(name), ExitStack() as stack:
        stream = sys.stdout
        if name != "-":
            stream = stack.enter_context(Path(name).open("w", newline="", encoding="utf-8"))
        writer = PulseWriter(stream, pulse_format(name), bursts=bursts)

        def write(pulses: Sequence[Pulse]) -> None:
            with _naming_faults(name):
                for pulse in pulses:
                    writer.write(pulse)

        yield write


@contextmanager
def _naming_faults(name: str) -> Iterator[None]:
    """Report which output cannot be written; a closed pipe (``| head``) is not an error."""
    try:
        yield
    except BrokenPipeError:
        # What Python still holds for stdout would fail once more when it exits.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise
    except OSError as error:
        raise _cannot_write(name, error) from error


def _cannot_write(name: str, error: OSError) -> RecordingError:
    remedy = {
        errno.ENOENT: f"Make the directory first: mkdir -p {Path(name).parent}",
        errno.ENOSPC: "Free space, or give another path with -o",
    }.get(error.errno or 0, "Give a writable path with -o")
    return RecordingError(
        f"cannot write {'standard output' if name == '-' else name}: {error.strerror}",
        remedy=remedy,
    )


@contextmanager
def stop_on_signals(within_s: float | None = None) -> Iterator[Callable[[], int | None]]:
    """Catch Ctrl-C and SIGTERM, so that the pulses found so far are still written.

    A second Ctrl-C ends the program at once.

    `within_s`: time after which unfinished work is interrupted by KeyboardInterrupt [s]. After
    twice this time the program is ended, so the output must be valid at any moment.
    """
    seen: list[int] = []
    timers: list[threading.Timer] = []

    def note(number: int, _frame: FrameType | None) -> None:
        seen.append(number)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if within_s is not None:
            signal.signal(signal.SIGALRM, signal.default_int_handler)
            signal.setitimer(signal.ITIMER_REAL, within_s)
            timers.append(threading.Timer(2.0 * within_s, os._exit, [128 + number]))
            timers[-1].daemon = True
            timers[-1].start()

    before = {n: signal.signal(n, note) for n in (signal.SIGINT, signal.SIGTERM)}
    before[signal.SIGALRM] = signal.getsignal(signal.SIGALRM)
    try:
        yield lambda: seen[0] if seen else None
    finally:
        if timers:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for timer in timers:
            timer.cancel()
        for number, handler in before.items():
            signal.signal(number, handler)


def _report(
    summary: DetectionSummary,
    tags: Sequence[Tag],
    writer: FlightWriter | None,
    source: SampleSource,
) -> None:
    if not summary.samples:
        return
    lines = [
        f"tag {tag.tag_id}{f' ({tag.name})' if tag.name else ''}: "
        f"{summary.pulses[tag.tag_id]} pulses, {summary.confirmed[tag.tag_id]} confirmed"
        for tag in tags
    ]
    lines += [
        f"tag {tag_id}: frequency usable {100.0 * searched.usable_share:.0f} % of the time, "
        f"pulses of {searched.weakest_enr_db:.1f} dB and more are found"
        for tag_id, searched in summary.searched.items()
    ]
    lines += [
        f"tag {tag.tag_id}: {count} of its confirmed pulses may be of another tag "
        "(also_possible_tag_ids; `uavrt tags check` shows how to distinguish them)"
        for tag in tags
        if (count := summary.ambiguous.get(tag.tag_id, 0))
    ]
    lines += [
        f"tag {tag_id}: {count} pulses are a ghost of tag {original}, made in the receiver"
        for (tag_id, original), count in summary.ghosts.items()
    ]
    lines += summary.input_faults
    if summary.clipped:
        lines.append(
            f"{summary.clipped} pulses were clipped ({100.0 * summary.clipped_share:.2g} % of "
            "the time): their SNR is a lower bound. Reduce the radio's gain"
        )
    lines.append(
        f"{summary.signal_s:.1f} s of samples in {summary.elapsed_s:.1f} s "
        f"({summary.times_real_time:.1f} × real time), {summary.samples_lost} samples lost"
    )
    if source.total_samples is None:
        lines.append(_may_be_lost(summary, source))
    if summary.invalid_samples:
        lines.append(f"{summary.invalid_samples} channel samples were not numbers")
    if writer is not None:
        lines.append(f"{writer.with_pose} pulses with a pose, {writer.without_pose} without")
        if writer.without_pose and not writer.with_pose:
            lines.append("no pulse lies within the flight: check --start-time")
        lines.append(f"flight: {writer.directory}")
    notice("\n".join(lines))


def _may_be_lost(summary: DetectionSummary, source: SampleSource) -> str:
    """Sentence on samples that a live stream may have lost without counting them."""
    why = getattr(source, "unseen_losses", None)
    if why is not None:
        return f"{why}: times are counted from the first sample, and losses are not detected"
    most = most_lost(
        summary.samples_unsure,
        samples=summary.samples,
        sample_rate_hz=summary.samples / max(summary.signal_s, 1e-3),
    )
    if not summary.samples_unsure:
        return f"up to {most} more samples may be lost, or the radio's rate is off"
    share = summary.samples_unsure / (summary.samples + summary.samples_unsure)
    return (
        f"rate or loss: the radio is {1e6 * share:.0f} ppm slow, or up to {most} more "
        "samples are lost"
    )
