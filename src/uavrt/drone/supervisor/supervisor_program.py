"""The supervisor's main program: runs the system until SIGTERM."""

import asyncio
import gc
import os
import signal
import sys
from contextlib import suppress

import msgspec

from uavrt.config.settings import Settings
from uavrt.core.commands import SystemState
from uavrt.core.errors import UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import Command, Tag
from uavrt.drone.ipc.parent import adopt_orphans
from uavrt.drone.supervisor.core import Supervisor
from uavrt.drone.supervisor.start.launcher import Launcher
from uavrt.drone.supervisor.viewers import Viewers, require_unserved


async def supervise(settings: Settings, tags: tuple[Tag, ...], launcher: Launcher) -> None:
    """Run the system until SIGTERM or SIGINT.

    With tags, or after an interrupted flight, detection starts at once.
    """
    viewers = Viewers()
    supervisor = Supervisor(settings, on_record=viewers.show, launcher=launcher)
    viewers.supervisor = supervisor
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, supervisor.stop)
    if settings.status_socket:
        require_unserved(settings.status_socket)
    supervisor.claim()
    if supervisor.mission.state is not SystemState.DETECTING:
        for command in start_commands(tags):
            reply = supervisor.command(command)
            if not reply.accepted:
                raise UavrtError(f"cannot start detecting: {reply.message}")
    gc.freeze()  # what was imported stays: see `HeapKeeper`
    server = await viewers.serve(settings.status_socket) if settings.status_socket else None
    adopt_orphans()
    try:
        await supervisor.run()
    finally:
        if server is not None and settings.status_socket:
            server.close()
            with suppress(OSError):
                os.unlink(settings.status_socket)


def start_commands(tags: tuple[Tag, ...]) -> list[Command]:
    """Return the commands that upload tags and start detection; empty without tags."""
    if not tags:
        return []
    return [
        Command(name="start_tags", request_id=1, source="command line"),
        *(
            Command(name="add_tag", request_id=2 + i, tag=tag, source="command line")
            for i, tag in enumerate(tags)
        ),
        Command(name="end_tags", request_id=2 + len(tags), source="command line"),
        Command(name="start_detection", request_id=3 + len(tags), source="command line"),
    ]


def run(launcher: Launcher, settings_json: str, tags_json: str = "[]") -> int:
    """Run the supervisor and return the exit status."""
    settings = msgspec.json.decode(settings_json, type=Settings)
    tags = msgspec.json.decode(tags_json, type=tuple[Tag, ...])
    try:
        asyncio.run(supervise(settings, tags, launcher))
    except UavrtError as error:
        print(f"uavrt: {error}", file=sys.stderr)  # noqa: T201 - the user's terminal
        return 2
    finally:
        launcher.close()
    get_logger().info("all processes stopped")
    return 0
