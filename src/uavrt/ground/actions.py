"""Which button may be pressed when, and why not. Pure; the page only draws it."""

from dataclasses import dataclass
from typing import Any

from uavrt.messages import SystemState

ACTIONS = {
    "send_tags": "Send tags",
    "start": "Start",
    "stop": "Stop",
    "capture": "Capture raw",
    "mark": "Mark",
    "save_logs": "Save logs",
    "clean_logs": "Clean logs",
    "radio_status": "Radio status",
    "parameters": "Parameters",
}
"""The buttons of a flight, in their order; behind "mark" those of the drone's upkeep."""
ALWAYS = ("radio_status", "parameters")
"""What the drone answers in every state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Busy:
    """A command that is under way."""

    action: str
    text: str
    done: int = 0
    whole: int = 0
    """Steps in all; 0 when unknown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """What decides over the buttons."""

    link_open: bool
    drone_present: bool
    state: SystemState | None
    """None when the drone does not tell, as the thesis's."""
    tags: int
    """Tags in the table."""
    tags_sent: bool
    busy: Busy | None
    flight_open: bool
    foreign: bool = False
    """Another autopilot answers under our vehicle's number."""


def action_states(now: Situation) -> dict[str, dict[str, Any]]:
    """For each action whether it is enabled, and the reason when not."""
    reasons = {action: _reason(action, now) for action in ACTIONS}
    return {
        action: {"label": ACTIONS[action], "enabled": reason is None, "reason": reason}
        for action, reason in reasons.items()
    }


def _reason(action: str, now: Situation) -> str | None:
    if action == "mark":
        return None if now.flight_open else "No flight yet: start first"
    if not now.link_open:
        return "Not connected: choose the connection under Set-up"
    if not now.drone_present:
        return "The drone is not heard: check its power and the radio"
    if now.busy is not None:
        return f"Wait: {now.busy.text}"
    if now.foreign and action != "stop":
        return "Two vehicles have the same number: choose one above"
    if action in ALWAYS:
        return None
    detecting = now.state is SystemState.DETECTING
    capturing = now.state is SystemState.CAPTURING
    match action:
        case "stop":
            idle = now.state is not None and not (detecting or capturing)
            return "Nothing runs" if idle else None
        case "send_tags" if now.tags == 0:
            return "No tags: type them in under Set-up"
        case "start" | "capture" | "save_logs" | "clean_logs" if (
            now.state is SystemState.RECEIVING_TAGS
        ):
            return "Tags are being sent"
        case "start" if now.state is SystemState.IDLE:
            return "Send the tags first"
        case "start" if not now.tags_sent and now.tags and not detecting:
            return "The tag table has changed: send the tags first"
    if detecting:
        return "Detecting: stop first"
    if capturing:
        return "Capturing: wait until it has ended"
    return None
