"""The socket by which a running system is watched."""

import asyncio
import errno
import os
import socket
import stat
from collections.abc import Callable
from pathlib import Path

import pytest
from some import some

from uavrt.core.errors import ConfigError
from uavrt.drone.supervisor.viewers import Viewers


async def test_two_systems_cannot_share_a_socket(tmp_path: Path) -> None:
    path = str(tmp_path / "status.sock")
    server = await Viewers().serve(path)
    with pytest.raises(ConfigError, match="another uavrt is already using"):
        await Viewers().serve(path)
    # The first is still watched.
    _, writer = await asyncio.open_unix_connection(path)
    writer.close()
    await writer.wait_closed()
    some(server).close()
    await asyncio.sleep(0.05)  # the connections end


async def test_a_card_that_takes_nothing_ends_no_flight_for_want_of_a_socket(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(number: int) -> Callable[..., None]:
        def unlink(_path: str) -> None:
            raise OSError(number, os.strerror(number))

        return unlink

    for number in (errno.EROFS, errno.ENOSPC):
        monkeypatch.setattr(os, "unlink", refused(number))
        assert await Viewers().serve(str(tmp_path / "status.sock")) is None
    monkeypatch.setattr(os, "unlink", refused(errno.EACCES))
    with pytest.raises(ConfigError, match="Permission denied"):
        await Viewers().serve(str(tmp_path / "status.sock"))


async def test_a_socket_that_a_killed_system_left_is_taken_over(tmp_path: Path) -> None:
    path = tmp_path / "status.sock"
    left = socket.socket(socket.AF_UNIX)
    left.bind(str(path))
    left.close()
    server = await Viewers().serve(str(path))
    assert stat.S_IMODE(path.stat().st_mode) & 0o007 == 0  # closed to everybody else
    some(server).close()
