"""Decide which buttons of the page are enabled, with a reason for each disabled one. No I/O."""

from dataclasses import dataclass
from typing import Any

from uavrt.core.commands import COMMANDS, Accepted, SystemState, outcome

COMMAND_OF_ACTION = {row.button.action: row for row in COMMANDS.values() if row.button}
"""Drone command of each button, by the button's action."""
BUTTONS = tuple(row.button for row in COMMANDS.values() if row.button)
ACTIONS = {**{button.action: button.label for button in BUTTONS}, "mark": "Mark"}
"""Label of each button, by its action; all actions but "mark" send a command to the drone."""
REFUSALS_BY_STATE = {
    SystemState.IDLE: "Send the tags first",
    SystemState.RECEIVING_TAGS: "Tags are being sent",
    SystemState.DETECTING: "Detection is running: press Stop first",
    SystemState.CAPTURING: "Raw data are being recorded: wait until the recording has ended",
}
"""Reason why a button is disabled, by the drone's state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Busy:
    """A command of the operator that is in progress, and how far it has come."""

    action: str
    text: str
    done: int = 0
    whole: int = 0
    """Total number of steps of the command; 0 while unknown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """State of drone and link that decides which buttons are enabled."""

    link_open: bool
    drone_present: bool
    state: SystemState | None
    """State that the drone reports; None if its software reports none, as in the thesis."""
    tags: int
    """Number of tags in the ground station's table."""
    tags_sent: bool
    busy: Busy | None
    flight_open: bool
    foreign: bool = False
    """True while two autopilots use the number of the served vehicle."""
    silent_s: float = 0.0
    """Time since the last contact with the drone, or since the start of the station [s]."""


def action_states(now: Situation) -> dict[str, dict[str, Any]]:
    """For each action: its label, whether it is enabled, the reason if not, and its fields."""
    reasons = {action: _reason(action, now) for action in ACTIONS}
    return {
        action: {"label": ACTIONS[action], "enabled": reason is None, "reason": reason}
        | _asked_for(action)
        for action, reason in reasons.items()
    }


def _asked_for(action: str) -> dict[str, Any]:
    """Names and units of the values that the page requests for an action; empty if none."""
    row = COMMAND_OF_ACTION.get(action)
    if row is None or not row.fields or not (row.button and row.button.asking):
        return {}
    return {"fields": [{"name": one.name, "unit": one.unit} for one in row.fields]}


def unreachable(now: Situation) -> str | None:
    """Reason why no command can be sent, not even a stop; None if commands can be sent."""
    if not now.link_open:
        return "Not connected: choose the connection under Set-up"
    if not now.drone_present:
        return "No contact with the drone: check its power and the radio link"
    return wait_for(now)


def cannot_command(now: Situation) -> str | None:
    """Reason why no command except a stop can be sent; None if all can be sent."""
    reason = unreachable(now)
    if reason is None and now.foreign:
        return "Two vehicles have the same number: choose one of them above"
    return reason


def wait_for(now: Situation) -> str | None:
    """Message to wait for the command in progress; None if no command is in progress."""
    return None if now.busy is None else f"Please wait: {now.busy.text}"


def _reason(action: str, now: Situation) -> str | None:
    if action == "mark":
        return None if now.flight_open else "No flight yet: press Start first"
    reason = unreachable(now) if action == "stop" else cannot_command(now)
    if reason is not None:
        return reason
    if action == "send_tags" and now.tags == 0:
        return "No tags: enter them under Set-up"
    command = COMMAND_OF_ACTION[action].name
    if now.state is not None and not isinstance(outcome(now.state, command), Accepted):
        return (
            "Nothing is running, so there is nothing to stop"
            if action == "stop"
            else REFUSALS_BY_STATE[now.state]
        )
    if action == "start" and not now.tags_sent and now.tags:
        return "The tag table has changed: send the tags first"
    return None
