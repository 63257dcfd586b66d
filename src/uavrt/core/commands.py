"""The table of commands: effect, conditions, permitted senders, payload and texts.

The supervisor's rules, the payloads in the radio protocol, the ground station's requests and
buttons, and the answers on the page are derived from this table. A new command needs a row here
with name, number and fields, and an action in
`uavrt.drone.supervisor.mission.operator_commands`.

A command that is not allowed in a state is refused with a reason on which the operator can act.
A repeated command is accepted without effect, so a ground station may retry over a lossy link.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from math import inf
from typing import Any, Literal


class SystemState(StrEnum):
    """State of the supervisor; the radio protocol uses other numbers for the states."""

    IDLE = "idle"
    RECEIVING_TAGS = "receiving_tags"
    HAS_TAGS = "has_tags"
    DETECTING = "detecting"
    CAPTURING = "capturing"

    @property
    def words(self) -> str:
        """Name of the state in plain words, for the operator."""
        return {"receiving_tags": "receiving tags", "has_tags": "ready"}.get(self, self.value)


CommandName = Literal[
    "start_tags",
    "add_tag",
    "end_tags",
    "start_detection",
    "stop_detection",
    "raw_capture",
    "save_logs",
    "clean_logs",
    "radio_status",
    "set_parameter",
    "fly",
    "confirm_motion",
]

Generation = Literal["G0", "G1", "G2v1", "G2"]
"""Version of the radio protocol. G0: that of the thesis (February 2023). G1: the newest without
a version number (April 2026). G2v1: version 1, which has the commands of G1. G2: versions 4 to
7."""


class CommandId(IntEnum):
    """Numbers of commands and other payloads: the first field of every protocol payload."""

    ACK = 1
    START_TAGS = 2
    END_TAGS = 3
    TAG = 4
    START_DETECTION = 5
    STOP_DETECTION = 6
    PULSE = 7
    RAW_CAPTURE = 8
    HEARTBEAT = 9
    SAVE_LOGS = 12
    CLEAN_LOGS = 13
    AIRSPY_STATUS = 14
    OPERATION_PROGRESS = 21
    SET_LOG_LEVEL = 22
    DETECTOR_HEARTBEAT = 23


# ------------------------------------------------------------------- effects in a state


@dataclass(frozen=True, slots=True)
class Accepted:
    """The command is allowed; the system changes to `state`."""

    state: SystemState


@dataclass(frozen=True, slots=True)
class Repeated:
    """The command was carried out before, so that nothing changes."""

    message: str


@dataclass(frozen=True, slots=True)
class Refused:
    """The command is not allowed in this state."""

    reason: str


Outcome = Accepted | Repeated | Refused
States = Mapping[SystemState, Outcome]

_IDLE, _RECEIVING, _HAS_TAGS, _DETECTING, _CAPTURING = SystemState
_BUSY = Refused("detecting: send stop first")
_IN_CAPTURE = Refused("capturing: wait until it has ended")
NO_UPLOAD = "no upload is open"
_NO_UPLOAD = Refused(f"{NO_UPLOAD}: send START_TAGS first")
_NO_TAGS = Refused("no tags: send tags first")
_UPLOADING = Refused("tags are being sent: send END_TAGS first")
_NOTHING_RUNS = Repeated("not detecting")

ALWAYS: States = {state: Accepted(state) for state in SystemState}
BETWEEN_FLIGHTS: States = {
    _IDLE: Accepted(_IDLE),
    _RECEIVING: _UPLOADING,
    _HAS_TAGS: Accepted(_HAS_TAGS),
    _DETECTING: _BUSY,
    _CAPTURING: _IN_CAPTURE,
}


# ------------------------------------------------------------------------------------ the rows


class PermittedSender(StrEnum):
    """Stations that may send a command if only one station may command.

    `mission.commanding_station` selects whether that is so.
    """

    ANYBODY = "anybody"
    """Any station may send it, because the command changes nothing."""
    COMMANDER = "the commander"
    """Only the station in command may send it. After the end of a flight any station may, and
    it is then in command."""
    LAST_COMMANDER = "the last commander"
    """Only the station in command may send it, even after the end of the flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Button:
    """Texts on the ground station's page for the button of a command."""

    action: str
    label: str
    asking: str = ""
    """Text shown after a command without parameters until the drone acknowledges it."""
    done: str = ""
    """Text shown if the acknowledgement of the command has no text of its own."""
    any_page: bool = False
    """True if any open page may send the command, not only the page in command."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandField:
    """A number in the payload of a command: name, type, unit and range."""

    name: str
    kind: Literal["u32", "f64"] = "u32"
    """Type of the number on the link."""
    unit: str = ""
    low: float = -inf
    high: float = inf
    """Largest valid number; `low` is the smallest. Both are checked only if `member` is
    ``"values"``."""
    member: str | None = "values"
    """Field of `uavrt.core.messages.Command` that stores the number: the dictionary
    ``"values"``, or a field for this number alone, where 0 becomes None. None if the drone
    ignores the number."""
    from_g2: bool = False
    """True if the field is missing in the protocol versions before G2."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandRow:
    """Definition of one command: effect, permitted senders, payload and button."""

    name: CommandName
    meaning: str
    states: States
    """Effect of the command in each state of the drone's system."""
    permitted_sender: PermittedSender
    while_ending: bool = True
    """True if the command is allowed while the last pulses of a flight are being recorded."""
    number: CommandId | None = None
    """Number of the command in the radio protocol; None if the command is sent in another
    form."""
    lengths: Mapping[Generation, tuple[int, ...]] = field(default_factory=dict)
    """Lengths of the command's payload in each protocol version [bytes]; the newest version is
    last."""
    fields: tuple[CommandField, ...] = ()
    """Numbers that the command carries, in the order of the payload."""
    button: Button | None = None

    def fault(self, numbers: Sequence[float]) -> str | None:
        """Error text for the first number outside its range; None if all are valid."""
        for one, number in zip(self.fields, numbers, strict=False):
            if one.member == "values" and not one.low <= number <= one.high:
                bounds = f"{one.low:g} to {one.high:g} {one.unit}".rstrip()
                return f"{one.name} {number:g} is not supported: choose {bounds}"
        return None

    def members(self, numbers: Sequence[float]) -> dict[str, Any]:
        """Keyword arguments for `uavrt.core.messages.Command`, from a payload's numbers."""
        given = [*zip(self.fields, numbers, strict=False)]
        own = {one.member: number or None for one, number in given if one.member}
        values = {one.name: number for one, number in given if one.member == "values"}
        return own | {"values": values}


BARE, BARE_G2 = (4,), (8,)
"""Lengths of a command's payload without parameters [bytes], without and with a request id."""

_FREQUENCY = CommandField(name="center_frequency_hz", unit="Hz", member="center_frequency_hz")
_GAIN = CommandField(name="gain", member="gain")

_ROWS = (
    CommandRow(
        name="start_tags",
        meaning="clear the tag list; new tags follow",
        number=CommandId.START_TAGS,
        lengths={"G0": BARE, "G1": BARE, "G2": (16,)},
        permitted_sender=PermittedSender.COMMANDER,
        states={
            _IDLE: Accepted(_RECEIVING),
            _RECEIVING: Accepted(_RECEIVING),
            _HAS_TAGS: Accepted(_RECEIVING),
            _DETECTING: _BUSY,
            _CAPTURING: _IN_CAPTURE,
        },
        button=Button(action="send_tags", label="Send tags"),
    ),
    CommandRow(
        name="add_tag",
        meaning="one tag of the list; while detecting, new values for a tag being searched for",
        number=CommandId.TAG,
        lengths={"G0": (48,), "G1": (88,), "G2": (96,)},
        permitted_sender=PermittedSender.COMMANDER,
        states={
            _IDLE: _NO_UPLOAD,
            _RECEIVING: Accepted(_RECEIVING),
            _HAS_TAGS: _NO_UPLOAD,
            _DETECTING: Accepted(_DETECTING),
            _CAPTURING: _IN_CAPTURE,
        },
    ),
    CommandRow(
        name="end_tags",
        meaning="end of the tag list",
        number=CommandId.END_TAGS,
        lengths={"G0": BARE, "G1": BARE, "G2": (16,)},
        permitted_sender=PermittedSender.COMMANDER,
        states={
            _IDLE: _NO_UPLOAD,
            _RECEIVING: Accepted(_HAS_TAGS),
            _HAS_TAGS: Repeated("tags are loaded"),
            _DETECTING: _BUSY,
            _CAPTURING: _IN_CAPTURE,
        },
    ),
    CommandRow(
        name="start_detection",
        meaning="begin a flight and search for the tags",
        number=CommandId.START_DETECTION,
        lengths={"G0": BARE, "G1": (12, 16, 32, 40), "G2": (48,)},
        fields=(
            _FREQUENCY,
            _GAIN,
            CommandField(name="detection_mode", member=None),
            CommandField(name="detection_margin", kind="f64", member=None),
            CommandField(name="confidence_ratio", kind="f64", member=None),
            CommandField(name="debug_detector", member=None),
            CommandField(name="dump_spectrogram", member=None, from_g2=True),
        ),
        permitted_sender=PermittedSender.COMMANDER,
        while_ending=False,
        states={
            _IDLE: _NO_TAGS,
            _RECEIVING: _UPLOADING,
            _HAS_TAGS: Accepted(_DETECTING),
            _DETECTING: Repeated("already detecting"),
            _CAPTURING: _IN_CAPTURE,
        },
        button=Button(action="start", label="Start"),
    ),
    CommandRow(
        name="stop_detection",
        meaning="end the flight or the capture",
        number=CommandId.STOP_DETECTION,
        lengths={"G0": BARE, "G1": BARE, "G2": BARE_G2},
        permitted_sender=PermittedSender.COMMANDER,
        states={
            _IDLE: _NOTHING_RUNS,
            _RECEIVING: _NOTHING_RUNS,
            _HAS_TAGS: _NOTHING_RUNS,
            _DETECTING: Accepted(_HAS_TAGS),
            _CAPTURING: Accepted(_HAS_TAGS),
        },
        button=Button(action="stop", label="Stop", any_page=True),
    ),
    CommandRow(
        name="raw_capture",
        meaning="record some seconds of the band",
        number=CommandId.RAW_CAPTURE,
        lengths={"G1": (8, 12), "G2": (16,)},
        fields=(_GAIN, _FREQUENCY),
        permitted_sender=PermittedSender.COMMANDER,
        while_ending=False,
        states={
            _IDLE: Accepted(_CAPTURING),
            _RECEIVING: _UPLOADING,
            _HAS_TAGS: Accepted(_CAPTURING),
            _DETECTING: _BUSY,
            _CAPTURING: Repeated("already capturing"),
        },
        button=Button(action="capture", label="Capture raw"),
    ),
    CommandRow(
        name="save_logs",
        meaning="copy the flights to a plugged-in drive",
        number=CommandId.SAVE_LOGS,
        lengths={"G1": BARE, "G2": BARE_G2},
        permitted_sender=PermittedSender.LAST_COMMANDER,
        while_ending=False,
        states=BETWEEN_FLIGHTS,
        button=Button(
            action="save_logs",
            label="Save logs",
            asking="requesting to save the flights",
            done="saving",
        ),
    ),
    CommandRow(
        name="clean_logs",
        meaning="remove the flights",
        number=CommandId.CLEAN_LOGS,
        lengths={"G1": BARE, "G2": BARE_G2},
        permitted_sender=PermittedSender.LAST_COMMANDER,
        while_ending=False,
        states=BETWEEN_FLIGHTS,
        button=Button(
            action="clean_logs",
            label="Clean logs",
            asking="requesting to remove the flights",
            done="removing",
        ),
    ),
    CommandRow(
        name="radio_status",
        meaning="report whether the radio is connected",
        number=CommandId.AIRSPY_STATUS,
        lengths={"G1": BARE, "G2": BARE_G2},
        permitted_sender=PermittedSender.ANYBODY,
        states=ALWAYS,
        button=Button(
            action="radio_status",
            label="Radio status",
            asking="checking the radio",
            done="the radio is connected",
        ),
    ),
    CommandRow(
        name="set_parameter",
        meaning="change a setting; some settings take effect at the next start only",
        permitted_sender=PermittedSender.LAST_COMMANDER,
        states=ALWAYS,
        button=Button(action="parameters", label="Parameters"),
    ),
    CommandRow(
        name="fly",
        meaning="request a motion of the drone",
        permitted_sender=PermittedSender.LAST_COMMANDER,
        states=ALWAYS,
    ),
    CommandRow(
        name="confirm_motion",
        meaning="confirm the motion that the drone has proposed",
        permitted_sender=PermittedSender.LAST_COMMANDER,
        states=ALWAYS,
    ),
)
COMMANDS: dict[CommandName, CommandRow] = {row.name: row for row in _ROWS}
COMMAND_OF_NUMBER: dict[int, CommandRow] = {
    row.number: row for row in _ROWS if row.number is not None
}
"""Definitions of the commands, by their number in the radio protocol."""


def outcome(state: SystemState, command: CommandName) -> Outcome:
    """Effect of a command in a state: accepted, repeated or refused."""
    return COMMANDS[command].states[state]
