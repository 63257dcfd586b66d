"""Decide which buttons are enabled, and the reason if not. Pure; the page only draws them."""

from dataclasses import dataclass
from typing import Any

from uavrt.commands import COMMANDS, Accepted, SystemState, outcome

COMMAND_OF_ACTION = {row.button.action: row for row in COMMANDS.values() if row.button}
"""The drone's command behind each button."""
BUTTONS = tuple(row.button for row in COMMANDS.values() if row.button)
ACTIONS = {**{button.action: button.label for button in BUTTONS}, "mark": "Mark"}
"""The buttons and their labels; all but "mark" send something to the drone."""
NOT_NOW = {
    SystemState.IDLE: "Send the tags first",
    SystemState.RECEIVING_TAGS: "Tags are being sent",
    SystemState.DETECTING: "Detecting: stop first",
    SystemState.CAPTURING: "Capturing: wait until it has ended",
}
"""Reason why a state does not allow a command."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Busy:
    """A command in progress."""

    action: str
    text: str
    done: int = 0
    whole: int = 0
    """Number of steps; 0 when unknown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """What the buttons depend on."""

    link_open: bool
    drone_present: bool
    state: SystemState | None
    """The drone's state; None for a drone that sends none, such as the thesis's."""
    tags: int
    """Number of tags in the table."""
    tags_sent: bool
    busy: Busy | None
    flight_open: bool
    foreign: bool = False
    """True while another autopilot answers under our vehicle's number."""
    silent_s: float = 0.0
    """Time since the last contact, or since the start of the station [s]."""


def action_states(now: Situation) -> dict[str, dict[str, Any]]:
    """Get for each action whether it is enabled, and the reason if not."""
    reasons = {action: _reason(action, now) for action in ACTIONS}
    return {
        action: {"label": ACTIONS[action], "enabled": reason is None, "reason": reason}
        for action, reason in reasons.items()
    }


def unreachable(now: Situation) -> str | None:
    """Get the reason why no command can be sent at all; None if one can."""
    if not now.link_open:
        return "Not connected: choose the connection under Set-up"
    if not now.drone_present:
        return "No contact with the drone: check its power and the radio"
    return wait_for(now)


def cannot_command(now: Situation) -> str | None:
    """Get the reason why only a stop can be sent; None if every command can."""
    reason = unreachable(now)
    if reason is None and now.foreign:
        return "Two vehicles have the same number: choose one above"
    return reason


def wait_for(now: Situation) -> str | None:
    """Name the command that must end before another can be sent; None if there is none."""
    return None if now.busy is None else f"Please wait: {now.busy.text}"


def _reason(action: str, now: Situation) -> str | None:
    if action == "mark":
        return None if now.flight_open else "No flight yet: start first"
    reason = unreachable(now) if action == "stop" else cannot_command(now)
    if reason is not None:
        return reason
    if action == "send_tags" and now.tags == 0:
        return "No tags: type them in under Set-up"
    command = COMMAND_OF_ACTION[action].name
    if now.state is not None and not isinstance(outcome(now.state, command), Accepted):
        return "Nothing is running" if action == "stop" else NOT_NOW[now.state]
    if action == "start" and not now.tags_sent and now.tags:
        return "The tag table has changed: send the tags first"
    return None
