"""A mission as a freshly started supervisor has it, and an operator who commands it."""

from itertools import count
from pathlib import Path
from typing import Any

import made

from uavrt.config.settings import RadioSettings, RecordingSettings, Settings
from uavrt.core.messages import Command, CommandReply, FlightInfo, Tag

RADIO = RadioSettings(center_frequency_hz=148.7e6)


class Operator:
    """Commands a mission whose flights lie in `directory`, and keeps what it reports.

    `options`: of the mission, such as its tuner.
    `**settings`: that differ from the usual ones.
    """

    def __init__(
        self, directory: Path, options: dict[str, Any] | None = None, **settings: Any
    ) -> None:
        self.texts: list[str] = []
        self.flights: list[FlightInfo] = []
        self.corrected: list[FlightInfo] = []
        self.changes: list[Settings] = []
        usual: dict[str, Any] = {
            "recording": RecordingSettings(directory=str(directory)),
            "radio": RADIO,
        }
        self.mission = made.mission(
            Settings(**(usual | settings)),
            directory,
            notify=lambda _severity, text: self.texts.append(text),
            on_start=self.flights.append,
            on_correction=self.corrected.append,
            on_settings=self.changes.append,
            **(options or {}),
        )
        self._numbers = count(1000)

    @property
    def state(self) -> str:
        """``"idle"``, ``"has_tags"``, ``"detecting"`` …"""
        return self.mission.state.value

    def say(self, name: Any, source: str = "", **details: Any) -> CommandReply:
        """Send a command."""
        return self.mission.command(
            Command(name=name, request_id=next(self._numbers), source=source, **details)
        )

    def refusal(self, name: Any, source: str = "", **details: Any) -> str:
        """Send a command that must be refused; the reason."""
        reply = self.say(name, source, **details)
        assert not reply.accepted
        return reply.message

    def set(self, name: str, value: float, source: str = "", **details: Any) -> CommandReply:
        """Set a parameter."""
        return self.say("set_parameter", source, parameter=name, value=value, **details)

    def send_tags(self, *tags: Tag, source: str = "", count: int | None = None) -> None:
        """Send a list of tags, which must be taken."""
        assert self.say("start_tags", source).accepted
        for tag in tags:
            reply = self.say("add_tag", source, tag=tag)
            assert reply.accepted, reply.message
        reply = self.say("end_tags", source, tag_count=count)
        assert reply.accepted, reply.message

    def detect(self, *tags: Tag, source: str = "") -> None:
        """Send tags and start, which must be taken."""
        self.send_tags(*tags, source=source)
        reply = self.say("start_detection", source)
        assert reply.accepted, reply.message
