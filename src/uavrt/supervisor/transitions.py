"""The one transition table: what each command does in each state.

A command that a state does not allow is refused with a reason the operator can act on; nothing
can lock up (the thesis's §6.2 wish). A repeated command is accepted and changes nothing, so a
ground station may retry over a lossy link.
"""

from dataclasses import dataclass

from uavrt.messages import CommandName, SystemState

S = SystemState


@dataclass(frozen=True, slots=True)
class Accepted:
    """The command is done; the system goes to `state`."""

    state: SystemState


@dataclass(frozen=True, slots=True)
class Repeated:
    """The command was done before; nothing changes."""

    message: str


@dataclass(frozen=True, slots=True)
class Refused:
    """The command is not allowed now."""

    reason: str


Outcome = Accepted | Repeated | Refused

_BUSY = Refused("detecting: send stop first")
_CAPTURING = Refused("capturing: wait until it has ended")
_NO_UPLOAD = Refused("no upload is open: send START_TAGS first")
_NO_TAGS = Refused("no tags: send tags first")
_UPLOADING = Refused("tags are being sent: send END_TAGS first")

TRANSITIONS: dict[tuple[SystemState, CommandName], Outcome] = {
    (S.IDLE, "start_tags"): Accepted(S.RECEIVING_TAGS),
    (S.IDLE, "add_tag"): _NO_UPLOAD,
    (S.IDLE, "end_tags"): _NO_UPLOAD,
    (S.IDLE, "start_detection"): _NO_TAGS,
    (S.IDLE, "stop_detection"): Repeated("not detecting"),
    (S.RECEIVING_TAGS, "start_tags"): Accepted(S.RECEIVING_TAGS),
    (S.RECEIVING_TAGS, "add_tag"): Accepted(S.RECEIVING_TAGS),
    (S.RECEIVING_TAGS, "end_tags"): Accepted(S.HAS_TAGS),
    (S.RECEIVING_TAGS, "start_detection"): _UPLOADING,
    (S.RECEIVING_TAGS, "stop_detection"): Repeated("not detecting"),
    (S.HAS_TAGS, "start_tags"): Accepted(S.RECEIVING_TAGS),
    (S.HAS_TAGS, "add_tag"): _NO_UPLOAD,
    (S.HAS_TAGS, "end_tags"): Repeated("tags are loaded"),
    (S.HAS_TAGS, "start_detection"): Accepted(S.DETECTING),
    (S.HAS_TAGS, "stop_detection"): Repeated("not detecting"),
    (S.DETECTING, "start_tags"): _BUSY,
    (S.DETECTING, "add_tag"): _BUSY,
    (S.DETECTING, "end_tags"): _BUSY,
    (S.DETECTING, "start_detection"): Repeated("already detecting"),
    (S.DETECTING, "stop_detection"): Accepted(S.HAS_TAGS),
    (S.CAPTURING, "start_tags"): _CAPTURING,
    (S.CAPTURING, "add_tag"): _CAPTURING,
    (S.CAPTURING, "end_tags"): _CAPTURING,
    (S.CAPTURING, "start_detection"): _CAPTURING,
    (S.CAPTURING, "stop_detection"): Accepted(S.HAS_TAGS),
    (S.IDLE, "raw_capture"): Accepted(S.CAPTURING),
    (S.RECEIVING_TAGS, "raw_capture"): _UPLOADING,
    (S.HAS_TAGS, "raw_capture"): Accepted(S.CAPTURING),
    (S.DETECTING, "raw_capture"): _BUSY,
    (S.CAPTURING, "raw_capture"): Repeated("already capturing"),
    **{
        (state, command): Accepted(state)
        for state in (S.IDLE, S.HAS_TAGS)
        for command in ("save_logs", "clean_logs")
    },
    **{
        (state, command): reason
        for state, reason in (
            (S.RECEIVING_TAGS, _UPLOADING),
            (S.DETECTING, _BUSY),
            (S.CAPTURING, _CAPTURING),
        )
        for command in ("save_logs", "clean_logs")
    },
    **{(state, "radio_status"): Accepted(state) for state in SystemState},
    # Allowed always: what is not in force at once waits for the next start.
    **{(state, "set_parameter"): Accepted(state) for state in SystemState},
}


def outcome(state: SystemState, command: CommandName) -> Outcome:
    """Get what `command` does in `state`."""
    return TRANSITIONS[state, command]
