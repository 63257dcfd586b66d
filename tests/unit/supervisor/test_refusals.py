"""What a mission says to a ground station that comes while it detects."""

from pathlib import Path

import made

from uavrt.config.settings import RadioSettings, RecordingSettings, Settings
from uavrt.core.messages import Command, CommandReply
from uavrt.link.tunnel.tag_lists import digest_in, tag_list_digest

TAG = made.tag()


def test_new_tags_are_refused_with_those_that_are_searched(tmp_path: Path) -> None:
    mission = made.mission(
        Settings(
            recording=RecordingSettings(directory=str(tmp_path)),
            radio=RadioSettings(center_frequency_hz=148.7e6),
        ),
        tmp_path,
        on_settings=lambda _settings: None,
    )

    def say(number: int, name: str, **details: object) -> CommandReply:
        return mission.command(Command(name=name, request_id=number, **details))  # type: ignore[arg-type]

    say(1, "start_tags")
    say(2, "add_tag", tag=TAG)
    say(3, "end_tags")
    assert say(4, "start_detection").accepted
    reply = say(5, "start_tags")
    assert not reply.accepted
    assert reply.message.startswith("detecting tags 2 (list ")
    assert reply.message.endswith(": send stop first")
    assert digest_in(reply.message) == tag_list_digest([TAG])
