"""Carry out or refuse the operator's commands; hold the resulting state, tags and flight."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import assert_never

from uavrt.config.parameters import RUN, run_wanted
from uavrt.config.settings import Settings
from uavrt.core.clock import boot_id
from uavrt.core.commands import COMMANDS, CommandName, Refused, Repeated, SystemState, outcome
from uavrt.core.errors import UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import Command, CommandReply, FlightInfo, Tag
from uavrt.core.newest import Newest
from uavrt.drone.supervisor.mission.commanding_station import CommandingStation
from uavrt.drone.supervisor.mission.kept_parameters import SettingsInForce
from uavrt.drone.supervisor.mission.mission_flights import Flights, Notify, Tuner
from uavrt.drone.supervisor.mission.saved_state import SavedState, StateStore
from uavrt.drone.supervisor.mission.search_planning import request_tuning
from uavrt.drone.supervisor.mission.storage.operations import Operations
from uavrt.drone.supervisor.mission.tag_upload import TagUpload
from uavrt.link.tunnel.tag_lists import searched_text

log = get_logger()

REPLIES_KEPT = 64


class Mission:
    """State, tags and flight of the system; each change is saved before it is acknowledged.

    `store` saves the state, so that a killed supervisor can resume. `notify` sends a text with
    its MAVLink severity to the operator.
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
        tuner: Tuner = request_tuning,
        operations: Operations | None = None,
    ) -> None:
        self._operations = operations
        self.upload = TagUpload(Path(settings.recording.directory))
        self.settings = SettingsInForce(settings, on_settings)
        self.flights = Flights(
            self.settings,
            self.upload,
            notify=notify,
            on_start=on_start,
            tuner=tuner,
            check_free=lambda: None if operations is None else operations.check_free(),
        )
        self.state = SystemState.IDLE
        self._store = store
        self._notify, self._on_stop, self._on_correction = notify, on_stop, on_correction
        self._replies: Newest[tuple[str, int], CommandReply] = Newest(REPLIES_KEPT)
        self.refused = 0
        self.commander = CommandingStation(pinned=settings.mavlink.first_commands)

    # ------------------------------------------------------------------ memory

    def resume(self) -> bool:
        """Restore the state that a killed supervisor saved; True if detection continues."""
        saved = self._store.read()
        if saved is None:
            return False
        self.upload.begin(saved.tags, saved.tags_sent)
        self.commander.name = saved.commander
        self.settings.resume(saved.gain, saved.waiting)
        self.state = SystemState.HAS_TAGS if saved.tags else SystemState.IDLE
        self.state = self.flights.resume(saved) or self.state
        self._save()
        log.info("resumed", state=self.state.value, tags=len(saved.tags))
        return self.state is SystemState.DETECTING

    def delete_saved_state(self) -> None:
        """Delete the saved state, because the supervisor ends normally."""
        self._store.remove()

    def _save(self) -> None:
        flights = self.flights
        self._store.keep(
            SavedState(
                boot_id=boot_id(),
                clock_offset_ns=flights.clock.offset_ns,
                state=self.state,
                tags=(*self.upload.tags.values(),),
                tags_sent=self.upload.sent,
                flight=flights.flight,
                last_flights=(*flights.last,),
                gain=self.settings.gain,
                waiting=self.settings.waiting,
                commander=self.commander.name,
            )
        )

    # ---------------------------------------------------------------- commands

    def command(self, command: Command) -> CommandReply:
        """Carry out or refuse a command; return the reply, for a repeated command its first
        one.
        """
        key = (command.source, command.request_id)
        if key not in self._replies:
            self._replies[key] = reply = self._decide(command)
            if not reply.accepted:
                self.refused += 1
                log.seldom(
                    self.refused, "command refused", command=command.name, reason=reply.message
                )
        return self._replies[key]

    def drop_replies(self) -> None:
        """Delete stored replies, because a restarted process reuses its request numbers."""
        self._replies.clear()

    def _decide(self, command: Command) -> CommandReply:
        if command.name == "set_parameter" and command.parameter == RUN.name:
            return self._decide_run(command)
        return self._decide_order(command)

    def _decide_run(self, command: Command) -> CommandReply:
        """Handle the parameter that starts detection with the last tags, or stops detection."""
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
        if self.flights.ending and not COMMANDS[command.name].while_ending:
            return _reply(command, False, "stopping: try again in a moment")
        if with_last_tags and self._has_no_list(command):
            try:
                self.upload.load_last(self.settings.now.detection.maximum_tags)
            except UavrtError as error:
                return _reply(command, False, str(error))
            self.state = SystemState.HAS_TAGS
            self._save()
        result = outcome(self.state, command.name)
        if isinstance(result, Refused):
            reason = result.reason
            if self.state is SystemState.DETECTING and command.name == "start_tags":
                tags = searched_text(self.upload.tags.values())
                reason = f"detecting {tags}: send stop first"
            return _reply(command, False, reason)
        if isinstance(result, Repeated):
            # A repeated start or capture gets the first answer, the directory.
            known = self.flights.flight
            if known is not None and command.name in ("start_detection", "raw_capture"):
                return _reply(command, True, known.directory)
            return _reply(command, True, result.message)
        try:
            message = self._carry_out(command)
        except UavrtError as error:
            return _reply(command, False, str(error))
        after = result.state
        if after is SystemState.HAS_TAGS and not self.upload.tags:
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
        mavlink = self.settings.now.mavlink
        locked = mavlink.key_file is not None and mavlink.key_required
        if locked and not command.sealed and command.source == "ros2":
            return "this drone has a key, so it refuses unauthenticated commands, as from ROS 2"
        return self.commander.refusal(command)

    def _note_commander(self, command: Command) -> None:
        if self.commander.accepted(command):
            log.info(
                "ground station that commands the drone changed",
                source=command.source,
                sealed=command.sealed,
            )
            self._save()

    def _carry_out(self, command: Command) -> str:
        match command.name:
            case "start_tags":
                self.upload.begin()
            case "add_tag" if self.state is SystemState.DETECTING:
                return self._correct_tag(command.tag)
            case "add_tag":
                self.upload.add(command.tag, self.settings.now.detection.maximum_tags)
            case "end_tags":
                return self.upload.end(command.tag_count)
            case "start_detection":
                self.upload.check_complete(command.tag_count)
                self.settings.use_start(command)
                return self.flights.begin(command.center_frequency_hz).directory
            case "stop_detection":
                directory = self.flights.mark_ending()
                self._on_stop()
                return directory
            case "set_parameter":
                detecting = self.state is SystemState.DETECTING
                said = self.settings.set(command.parameter, command.value, detecting=detecting)
                self._save()
                return said
            case "raw_capture":
                self.settings.use_start(command)
                return self.flights.begin_capture(command.center_frequency_hz).directory
            case "save_logs" | "clean_logs":
                if self._operations is None:
                    raise UavrtError("only a running supervisor can save or clean logs")
                return self._operations.begin(command.name, command.source)
            case "radio_status" | "fly" | "confirm_motion":
                pass  # other parts carry them out
            case _:
                assert_never(command.name)
        return ""

    def _correct_tag(self, tag: Tag | None) -> str:
        corrected = self.flights.correct(tag)
        if tag is None or corrected is None:
            return "unchanged"
        flight, words, warnings = corrected
        self._save()
        self._on_correction(flight)
        for text in (f"Tag {tag.tag_id}: {words}", *warnings):
            self._notify(5, text)
        return words

    def _has_no_list(self, command: Command) -> bool:
        """True if a start must first load the last complete list of tags.

        Another station's unfinished upload is replaced only by a sealed (authenticated)
        command, or after a minute of that station's silence.
        """
        if self.state is SystemState.RECEIVING_TAGS:
            alone = self.settings.now.mavlink.first_commands
            return alone and self.commander.name != command.source
        return self.state is SystemState.IDLE

    def flight_ended(self) -> FlightInfo | None:
        """End the present flight, once its last pulse is recorded; return it, or None."""
        flight = self.flights.ended()
        self.commander.flight_ended()
        self._save()
        return flight


def _reply(command: Command, accepted: bool, message: str) -> CommandReply:
    return CommandReply(
        request_id=command.request_id, name=command.name, accepted=accepted, message=message
    )
