"""The operator's commands and their state: tags and flight. It knows no processes."""

import math
import shutil
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from uavrt.clock import Clock, boot_id, wall_ns
from uavrt.commands import COMMANDS, CommandName, Refused, Repeated, SystemState, outcome
from uavrt.config.code_rules import near_codes, same_codes
from uavrt.config.parameters import (
    PARAMETERS,
    RUN,
    check_start,
    parameter_values,
    run_wanted,
    tags_with_overrides,
    tuned_frequency,
    warnings_of_band,
    with_parameter,
)
from uavrt.config.settings import Settings
from uavrt.config.tag_files import faults_of_tags
from uavrt.errors import UavrtError
from uavrt.log import get_logger
from uavrt.messages import Command, CommandReply, FlightInfo, Tag
from uavrt.recording.kept_file import KeptFile
from uavrt.supervisor.mission.flight_opening import last_written_ns, new_flight
from uavrt.supervisor.mission.kept_parameters import KeptParameters
from uavrt.supervisor.mission.operations import Operations
from uavrt.supervisor.mission.saved_state import SavedState, StateStore
from uavrt.supervisor.mission.tuning import UNMEASURED_TAGS, Tuning, TuningQuestion, ask_tuner
from uavrt.supervisor.mission.who_commands import Commander
from uavrt.tunnel.tag_lists import searched_text
from uavrt.units import NANOSECONDS_PER_SECOND

log = get_logger()
_MOST_NEAR = 3
"""Pairs of codes that are named at the beginning of a flight; the page names all."""

LAST_TAGS_NAME = "last_tags.json"
"""File of the last tags, for a ground station that cannot send tags (`DET_RUN`)."""
REPLIES_KEPT = 64
LAST_FLIGHTS = 3
"""Number of ended flights that connection and recorder still serve."""
RESUME_WITHIN_S = 900.0
"""Age of a flight up to which detection resumes after a restart of the computer [s]. Covers a
battery change or a brown-out in the air, but not last week's flight."""

Notify = Callable[[int, str], None]
Tuner = Callable[[TuningQuestion], Tuning]
_MOST_TAGS = 1000
"""Most tags of a list, if `detection.maximum_tags` is not set."""
_CARRIED = 0.4
"""Half of the usable band, as a share of the radio's rate."""
_USUAL_WINDOW_HZ = 500.0
"""Half-width of the search for which every channel has room [Hz]."""


class Mission:
    """State, tags and flight; every change is saved before it is acknowledged.

    `store`: keeps the state over an unclean end. `notify`: sends a text (severity, text) to the
    operator. `on_start`, `on_stop`: called when a flight begins, and when its end was
    commanded. `on_correction`: called when a tag of the flight has other values. `on_settings`:
    called when an operator has changed a setting. `tuner`: finds the radio's frequency for the
    tags'. `operations`: saves and removes flights.
    """

    def __init__(
        self,
        settings: Settings,
        store: StateStore,
        *,
        notify: Notify,
        on_start: Callable[[FlightInfo], None],
        on_stop: Callable[[], None],
        on_correction: Callable[[FlightInfo], None] = lambda _flight: None,
        on_settings: Callable[[Settings], None] = lambda _settings: None,
        tuner: Tuner = ask_tuner,
        operations: Operations | None = None,
    ) -> None:
        self._operations = operations
        self._kept = KeptParameters(Path(settings.recording.directory), settings)
        self._last_tags = KeptFile(
            Path(settings.recording.directory) / LAST_TAGS_NAME, tuple[Tag, ...], "last tags"
        )
        self.settings = self.flight_settings = self._kept.applied_to(settings)
        """Settings for the next start, and those in force in the present flight."""
        self.clock = Clock.start()
        self.state = SystemState.IDLE
        self._ask_tuner = tuner
        self.tags: dict[int, Tag] = {}
        self._tags_sent = 0
        """Number of tags in this upload by its sender; 0 if not sent."""
        self.flight: FlightInfo | None = None
        self.last_flights: deque[str] = deque(maxlen=LAST_FLIGHTS)
        """Directories of ended flights, the newest last."""
        self.ending = False
        """Whether the flight's last pulses are on their way; no new one can begin yet."""
        self._gain: int | None = None
        self._store = store
        self._notify, self._on_start, self._on_stop = notify, on_start, on_stop
        self._on_settings, self._on_correction = on_settings, on_correction
        self._replies: dict[tuple[str, int], CommandReply] = {}
        self.refused = 0
        """Number of refused commands."""
        self.commander = Commander(pinned=settings.mavlink.first_commands)

    # ------------------------------------------------------------------ memory

    def resume(self) -> bool:
        """Continue after a supervisor that did not stop in good order; True if detecting.

        Within the same boot the flight goes on with its clock. After a restart of the computer
        the clock is a new one, and so is the flight; see `RESUME_WITHIN_S`.
        """
        saved = self._store.read()
        if saved is None:
            return False
        self.tags = {tag.tag_id: tag for tag in saved.tags}
        self._tags_sent = saved.tags_sent
        self.commander.name = saved.commander
        with suppress(UavrtError):
            self._use_gain(saved.gain)
        self.flight_settings = self.settings
        for name, value in saved.waiting.items():
            with suppress(UavrtError):
                self.flight_settings = with_parameter(self.flight_settings, name, value)
        self.state = SystemState.HAS_TAGS if self.tags else SystemState.IDLE
        flight = saved.flight
        same_boot = saved.boot_id == boot_id()
        self.last_flights.extend(d for d in saved.last_flights if same_boot or _recent(d))
        if flight is not None and flight.capture_s is not None:
            goes_on = same_boot and saved.state is SystemState.CAPTURING
            self._continue_capture(flight, saved.clock_offset_ns if goes_on else None)
        if saved.state is SystemState.DETECTING and flight is not None:
            if same_boot:
                self.clock = Clock(saved.clock_offset_ns)
                self._continue(flight)
            elif _recent(flight.directory):
                self._try_new_flight(flight.center_frequency_hz)
        if flight is not None and flight != self.flight and _recent(flight.directory):
            self.last_flights.append(flight.directory)
        self._save()
        log.info("resumed", state=self.state.value, tags=len(self.tags))
        return self.state is SystemState.DETECTING

    def _continue(self, flight: FlightInfo) -> None:
        if not Path(flight.directory).is_dir():
            self._try_new_flight(flight.center_frequency_hz)
            return
        self.flight, self.state = flight, SystemState.DETECTING
        self._on_start(flight)
        self._notify(4, f"Supervisor restarted: detecting {len(self.tags)} tags again")

    def _continue_capture(self, flight: FlightInfo, clock_offset_ns: int | None) -> None:
        """Record the rest of a raw capture; without a clock offset report what was recorded."""
        if clock_offset_ns is None or not Path(flight.directory).is_dir():
            self._notify(4, f"Raw capture ended by a restart: kept in {flight.directory}")
            return
        self.clock = Clock(clock_offset_ns)
        self.flight, self.state = flight, SystemState.CAPTURING
        self._on_start(flight)
        self._notify(4, "Supervisor restarted: recording the rest of the capture")

    def _try_new_flight(self, center_frequency_hz: float) -> None:
        try:
            self.begin_flight(center_frequency_hz)
        except UavrtError as error:
            self._notify(3, f"Supervisor restarted, but cannot detect: {error}")
            return
        self.state = SystemState.DETECTING
        self._notify(4, f"Computer restarted: detecting {len(self.tags)} tags again")

    def forget(self) -> None:
        """Remove the saved state after an end in good order."""
        self._store.forget()

    def _save(self) -> None:
        now = parameter_values(self.settings)
        in_flight = parameter_values(self.flight_settings)
        self._store.keep(
            SavedState(
                boot_id=boot_id(),
                clock_offset_ns=self.clock.offset_ns,
                state=self.state,
                tags=(*self.tags.values(),),
                tags_sent=self._tags_sent,
                flight=self.flight,
                last_flights=(*self.last_flights,),
                gain=self._gain,
                waiting={name: one for name, one in in_flight.items() if one != now[name]},
                commander=self.commander.name,
            )
        )

    # ---------------------------------------------------------------- commands

    def command(self, command: Command) -> CommandReply:
        """Carry out a command, or explain the refusal; a repeated one gets the same reply."""
        key = (command.source, command.request_id)
        if key not in self._replies:
            self._replies[key] = reply = self._decide(command)
            if not reply.accepted:
                self.refused += 1
                log.seldom(
                    self.refused, "command refused", command=command.name, reason=reply.message
                )
            while len(self._replies) > REPLIES_KEPT:
                del self._replies[next(iter(self._replies))]
        return self._replies[key]

    def forget_replies(self) -> None:
        """Drop old replies, because a new process restarts its request numbers."""
        self._replies.clear()

    def _decide(self, command: Command) -> CommandReply:
        if command.name == "set_parameter" and command.parameter == RUN.name:
            return self._decide_run(command)
        return self._decide_order(command)

    def _decide_run(self, command: Command) -> CommandReply:
        """Start with the last tags, or stop, by the rules of those commands."""
        try:
            start = run_wanted(math.nan if command.value is None else command.value)
        except UavrtError as error:
            return _reply(command, False, str(error))
        order: CommandName = "start_detection" if start else "stop_detection"
        reply = self._decide_order(replace(command, name=order), with_last_tags=start)
        return replace(reply, name=command.name)

    def _decide_order(self, command: Command, *, with_last_tags: bool = False) -> CommandReply:
        refusal = self._refusal(command)
        if refusal is not None:
            return _reply(command, False, refusal)
        if self.ending and not COMMANDS[command.name].while_ending:
            return _reply(command, False, "stopping: try again in a moment")
        if with_last_tags and self._has_no_list(command):
            try:
                self._take_last_tags()
            except UavrtError as error:
                return _reply(command, False, str(error))
        result = outcome(self.state, command.name)
        if isinstance(result, Refused):
            reason = result.reason
            if self.state is SystemState.DETECTING and command.name == "start_tags":
                reason = f"detecting {searched_text(self.tags.values())}: send stop first"
            return _reply(command, False, reason)
        if isinstance(result, Repeated):
            # A repeated start or capture gets the first answer, the directory.
            known = self.flight if command.name in ("start_detection", "raw_capture") else None
            return _reply(command, True, known.directory if known else result.message)
        try:
            message = self._carry_out(command)
        except UavrtError as error:
            return _reply(command, False, str(error))
        after = result.state
        if after is SystemState.HAS_TAGS and not self.tags:
            after = SystemState.IDLE  # a capture needs no tags
        changed, self.state = self.state is not after, after
        self._note_commander(command)
        if changed:
            log.info(
                "state", state=self.state.value, command=command.name, source=command.source
            )
            self._save()
        return _reply(command, True, message)

    def _refusal(self, command: Command) -> str | None:
        """Explain why a command of this sender is refused; the same for every wire."""
        mavlink = self.settings.mavlink
        locked = mavlink.key_file is not None and mavlink.key_required
        if locked and not command.sealed and command.source == "ros2":
            return "only sealed commands, and ROS 2 has no seal: this drone has a key"
        return self.commander.refusal(command)

    def _note_commander(self, command: Command) -> None:
        if self.commander.accepted(command):
            log.info("commander", source=command.source, sealed=command.sealed)
            self._save()

    def _carry_out(self, command: Command) -> str:
        match command.name:
            case "start_tags":
                self.tags.clear()
                self._tags_sent = 0
            case "add_tag" if self.state is SystemState.DETECTING:
                return self._correct_tag(command.tag)
            case "add_tag":
                self._add_tag(command.tag)
            case "end_tags":
                if not self.tags:
                    raise UavrtError("no tag was sent: send TAG before END_TAGS")
                self._check_codes()
                self._tags_sent = max(self._tags_sent, command.tag_count or 0)
                if len(self.tags) < self._tags_sent:
                    return f"{len(self.tags)} of {self._tags_sent} tags"
                self._last_tags.keep((*self.tags.values(),))
                return f"{len(self.tags)} tags"
            case "start_detection":
                self._check_complete(max(self._tags_sent, command.tag_count or 0))
                self._use_start(command)
                return self.begin_flight(command.center_frequency_hz).directory
            case "stop_detection":
                self.ending = True
                self._on_stop()
                return self.flight.directory if self.flight else ""
            case "set_parameter":
                return self._set_parameter(command.parameter, command.value)
            case "raw_capture":
                self._use_start(command)
                return self.begin_capture(command.center_frequency_hz).directory
            case "save_logs" | "clean_logs":
                if self._operations is None:
                    raise UavrtError("not here: only a running supervisor does that")
                return self._operations.begin(command.name, command.source)
        return ""

    def _check_codes(self) -> None:
        """Refuse codes that cannot be distinguished."""
        for one, two in same_codes(tuple(self.tags.values())):
            raise UavrtError(f"tags {one.tag_id} and {two.tag_id} have the same code")

    def _add_tag(self, tag: Tag | None) -> None:
        if tag is None:
            raise UavrtError("the tag is missing")
        if self.tags.get(tag.tag_id, tag) != tag:
            raise UavrtError(f"tag {tag.tag_id} was already sent with other values")
        _check_tag(tag)
        most = self.settings.detection.maximum_tags or _MOST_TAGS
        if tag.tag_id not in self.tags and len(self.tags) >= most:
            raise UavrtError(f"{most} tags are the most: see detection.maximum_tags")
        self.tags[tag.tag_id] = tag

    def _correct_tag(self, tag: Tag | None) -> str:
        """Change a tag's values in the flight that goes on."""
        known = None if tag is None else self.tags.get(tag.tag_id)
        if tag is None or known is None or self.flight is None:
            raise UavrtError(f"detecting {searched_text(self.tags.values())}: send stop first")
        tag = replace(tag, name=known.name)
        if tag == known:
            return "as it was"
        _check_tag(tag)
        if known.coded or tag.coded:
            raise UavrtError("coded tags cannot be corrected in flight: send stop first")
        flight = self.flight
        center_hz = flight.center_frequency_hz
        reach_hz = max(abs(one.frequency_hz - center_hz) for one in flight.tags)
        reach_hz = max(reach_hz, _CARRIED * flight.sample_rate_hz)
        if abs(tag.frequency_hz - center_hz) > reach_hz:
            raise UavrtError(f"not received at {center_hz / 1e6:.6f} MHz: send stop first")
        settings = self.flight_settings
        (searched,) = tags_with_overrides(settings, (tag,))
        tags = tuple(searched if one.tag_id == tag.tag_id else one for one in flight.tags)
        warnings: tuple[str, ...] = ()
        if settings.detection.frequency_window_hz > _USUAL_WINDOW_HZ:
            # What the search costs was measured at the start, when the computer was not busy.
            question = replace(self._question(tags, center_hz), spare_cores=None)
            warnings = self._ask_tuner(question).warnings
        self.tags[tag.tag_id] = tag
        self.flight = replace(flight, tags=tags)
        self._last_tags.keep(tuple(self.tags.values()))
        self._save()
        self._on_correction(self.flight)
        words = f"{tag.frequency_hz / 1e6:.6f} MHz, was {known.frequency_hz / 1e6:.6f}"
        if tag.frequency_hz == known.frequency_hz:
            before_s, now_s = known.pulse_intervals_s[-1], tag.pulse_intervals_s[-1]
            words = f"{1e3 * now_s:.0f} ms, was {1e3 * before_s:.0f}"
        for text in (f"Tag {tag.tag_id}: {words}", *warnings):
            self._notify(5, text)
        return words

    def _check_complete(self, sent: int) -> None:
        if len(self.tags) < sent:
            raise UavrtError(f"only {len(self.tags)} of {sent} tags came: send them all again")

    def _has_no_list(self, command: Command) -> bool:
        """Whether no complete list of tags is loaded.

        A station may command during another's upload only with a seal, or once that one has
        been silent for a minute: then the rest of the list will not come.
        """
        if self.state is SystemState.RECEIVING_TAGS:
            alone = self.settings.mavlink.first_commands
            return alone and self.commander.name != command.source
        return self.state is SystemState.IDLE

    def _take_last_tags(self) -> None:
        """Load the tags of the last upload, also before a restart; raises `UavrtError`."""
        tags = self._last_tags.read() or ()
        if not tags:
            raise UavrtError("no tags are known: send them once, by uavrt ground")
        self.tags.clear()
        self._tags_sent = 0
        try:
            for tag in tags:
                self._add_tag(tag)
        except UavrtError:
            self.tags.clear()
            raise
        self.state = SystemState.HAS_TAGS
        self._save()
        log.info("last tags", tags=len(self.tags))

    def _set_parameter(self, name: str | None, value: float | None) -> str:
        """Change a setting, now and for later starts; answer when it comes into force."""
        if name is None or value is None:
            raise UavrtError("the parameter or its value is missing")
        waits = self.state is SystemState.DETECTING and not PARAMETERS[name].live
        if not waits:
            self.flight_settings = with_parameter(self.flight_settings, name, value)
        self._use(with_parameter(self.settings, name, value))
        self._kept.keep(name, value)
        if name == "RADIO_GAIN":
            self._gain = None
        self._save()
        return f"{name} = {value:.7g}{', from the next start' if waits else ''}"

    def _use_start(self, command: Command) -> None:
        """Use the values of a start or a capture, if the radio supports them."""
        check_start(self.settings, command.center_frequency_hz, command.gain)
        self._use_gain(command.gain)

    def _use_gain(self, gain: int | None) -> None:
        """Use a start's gain, until another is set or uavrt is stopped."""
        if gain is not None:
            self._use(with_parameter(self.settings, "RADIO_GAIN", gain))
            self._gain = gain

    def _use(self, settings: Settings) -> None:
        if settings != self.settings:
            self.settings = settings
            self._on_settings(settings)

    # ------------------------------------------------------------------ flight

    def begin_flight(self, center_frequency_hz: float | None) -> FlightInfo:
        """Choose the radio's frequency (the operator's, the settings', the tuner's); begin.

        Raises `TunerError` if no radio frequency serves all the tags, `RecordingError` if the
        flight's directory cannot be made.
        """
        self._check_free()
        tags = tags_with_overrides(self.settings, self.tags.values())
        for tag in tags:
            _check_tag(tag)
        radio = self.settings.radio
        warnings: tuple[str, ...] = ()
        center_hz = center_frequency_hz or radio.center_frequency_hz
        if center_hz is not None:
            warnings = warnings_of_band(tags, center_hz, radio.sample_rate_hz)
        detection = self.settings.detection
        plain = detection.frequency_window_hz <= _USUAL_WINDOW_HZ
        if center_hz is None or not plain or len(tags) > UNMEASURED_TAGS:
            tuning = self._ask_tuner(self._question(tags, center_hz))
            center_hz, warnings = tuning.center_frequency_hz, warnings + tuning.warnings
        center_hz = tuned_frequency(radio, center_hz)
        self.clock, self.flight_settings = Clock.start(), self.settings
        self.flight = new_flight(self.settings, tags, self.clock, center_frequency_hz=center_hz)
        self._on_start(self.flight)
        count = len(self.tags)
        words = "1 tag" if count == 1 else f"{count} tags"
        self._notify(6, f"Detecting {words} at {center_hz:.0f} Hz")
        for warning in (*warnings, *self._words_of_near_codes(tags)):
            self._notify(5, warning)
        return self.flight

    def _words_of_near_codes(self, tags: Sequence[Tag]) -> list[str]:
        """Name codes that may be confused, in words for a radio link."""
        window_hz = self.settings.detection.frequency_window_hz
        pairs = [(one.tag_id, two.tag_id) for one, two, _ in near_codes(tags, window_hz)]
        words = [f"Codes {one}, {two} are easily mixed up" for one, two in pairs[:_MOST_NEAR]]
        if len(pairs) > _MOST_NEAR:
            words.append(f"{len(pairs) - _MOST_NEAR} more pairs of codes are as near")
        return words

    def begin_capture(self, center_frequency_hz: float | None) -> FlightInfo:
        """Begin to record the band; the frequency is the operator's, or as in a flight.

        Raises `UavrtError` if no frequency is known, the disk is nearly full, or flights are
        being copied.
        """
        self._check_free()
        radio, recording = self.settings.radio, self.settings.recording
        center_hz = center_frequency_hz or radio.center_frequency_hz
        if center_hz is None and not self.tags:
            raise UavrtError("no frequency: send tags first, or set RADIO_FREQ_KHZ")
        if center_hz is None:
            question = self._question(tuple(self.tags.values()), None)
            center_hz = self._ask_tuner(question).center_frequency_hz
        center_hz = tuned_frequency(radio, center_hz)
        with suppress(OSError):
            free_mb = shutil.disk_usage(recording.directory).free / 1e6
            if free_mb < recording.minimum_free_mb:
                raise UavrtError(f"disk nearly full: {free_mb:.0f} MB free; clean the logs")
        self.clock, self.flight_settings = Clock.start(), self.settings
        self.flight = new_flight(
            self.settings,
            (),
            self.clock,
            center_frequency_hz=center_hz,
            capture_s=recording.capture_s,
        )
        self._on_start(self.flight)
        self._notify(6, f"Capturing {recording.capture_s:g} s at {center_hz:.0f} Hz")
        return self.flight

    def _question(self, tags: tuple[Tag, ...], center_hz: float | None) -> TuningQuestion:
        detection = (self.flight_settings if self.flight else self.settings).detection
        measured = len(tags) > UNMEASURED_TAGS and not detection.maximum_tags
        return TuningQuestion(
            tags=tags,
            sample_rate_hz=self.settings.radio.sample_rate_hz,
            detection=detection,
            center_frequency_hz=center_hz,
            spare_cores=detection.worker_count if measured else None,
        )

    def _check_free(self) -> None:
        if self._operations is not None:
            self._operations.check_free()

    def flight_ended(self) -> FlightInfo | None:
        """Note that the last pulse is on its way; get the flight that ended."""
        flight, self.flight = self.flight, None
        if flight is not None:
            self.last_flights.append(flight.directory)
        self.ending = False
        self.commander.flight_ended()
        self._save()
        return flight


def _check_tag(tag: Tag) -> None:
    """Refuse, on any wire, what the tag files refuse."""
    faults = faults_of_tags([tag])
    if faults:
        raise UavrtError(faults[0])


def _recent(directory: str) -> bool:
    written_ns = last_written_ns(Path(directory))
    # A computer without a battery-backed clock may start in the past: that is recent too.
    return (
        written_ns is not None
        and wall_ns() - written_ns < RESUME_WITHIN_S * NANOSECONDS_PER_SECOND
    )


def _reply(command: Command, accepted: bool, message: str) -> CommandReply:
    return CommandReply(
        request_id=command.request_id, name=command.name, accepted=accepted, message=message
    )
