"""A signed frame of before a restart is refused after it, whatever the clock says."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
from some import some

from uavrt.drone.processes.connection_parts.signing_memory import TIMES_NAME, SigningMemory
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import Frame, FrameParser, FrameWriter
from uavrt.link.mavlink.sending.signing import EPOCH_S, Signing, SigningKey

KEY = SigningKey(bytes(range(32)))
NOW_NS = (EPOCH_S + 300_000_000) * 10**9
DAY_NS = 86_400 * 10**9
SECOND_NS = 10**9


def frame_at(time_ns: int, component_id: int = 190) -> Frame:
    """A frame of a ground station, signed at a time."""
    signer = Signing(KEY, lambda: time_ns)
    ping = dialect.Ping(time_usec=1, seq=2, target_system=0, target_component=0)
    writer = FrameWriter(255, component_id, lambda frame: signer.signature(frame, 1))
    (frame,) = FrameParser().feed(writer.encode(ping))
    return frame


def drone_at(time_ns: int, directory: Path) -> tuple[Signing, SigningMemory]:
    """A drone that starts at a time by its own clock."""
    signing = Signing(KEY, lambda: time_ns, "none")
    return signing, SigningMemory(signing, directory)


def run_a_flight(directory: Path) -> Frame:
    """Take a STOP, keep what is to be kept, and be killed."""
    signing, memory = drone_at(NOW_NS, directory)
    stop = frame_at(NOW_NS)
    assert signing.accepts(stop)
    content = some(memory.due(NOW_NS))
    memory.write(content)
    assert memory.due(NOW_NS + SECOND_NS) is None, "not so soon again"
    assert memory.due(NOW_NS + 5 * SECOND_NS) is None, "nothing is new"
    return stop


@pytest.mark.parametrize("clock_behind_ns", [0, 30 * DAY_NS])
def test_a_genuine_stop_is_refused_after_a_restart(
    tmp_path: Path, clock_behind_ns: int
) -> None:
    stop = run_a_flight(tmp_path)
    again, _ = drone_at(NOW_NS + SECOND_NS - clock_behind_ns, tmp_path)
    assert not again.accepts(stop)
    assert again.counters["signatures_repeated"] == 1
    # Of the last moments before the restart, which the file does not know yet.
    assert not again.accepts(frame_at(NOW_NS + 2 * SECOND_NS))
    assert again.accepts(frame_at(NOW_NS + 4 * SECOND_NS))


def test_a_clock_30_days_behind_takes_no_old_frame_of_a_new_station(tmp_path: Path) -> None:
    run_a_flight(tmp_path)
    again, _ = drone_at(NOW_NS - 30 * DAY_NS, tmp_path)
    assert not again.accepts(frame_at(NOW_NS - DAY_NS, component_id=191))
    assert again.accepts(frame_at(NOW_NS + SECOND_NS, component_id=192))


def test_after_a_power_cut_the_file_may_be_half_a_minute_old(tmp_path: Path) -> None:
    run_a_flight(tmp_path)
    kept = json.loads((tmp_path / TIMES_NAME).read_bytes())
    (tmp_path / TIMES_NAME).write_text(json.dumps(kept | {"boot_id": "another start"}))
    again, _ = drone_at(NOW_NS, tmp_path)
    assert not again.accepts(frame_at(NOW_NS + 30 * SECOND_NS))
    assert again.accepts(frame_at(NOW_NS + 41 * SECOND_NS))


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"boot_id": 1}', bytes(100)])
def test_a_damaged_file_costs_only_the_memory(
    tmp_path: Path, content: bytes, capsys: Any
) -> None:
    (tmp_path / TIMES_NAME).write_bytes(content)
    signing, _ = drone_at(NOW_NS, tmp_path)
    assert "signing times not read" in capsys.readouterr().err
    assert signing.accepts(frame_at(NOW_NS))


def test_a_disk_that_takes_nothing_stops_nothing(tmp_path: Path, capsys: Any) -> None:
    signing, memory = drone_at(NOW_NS, tmp_path / "file" / "flights")
    (tmp_path / "file").touch()
    assert signing.accepts(frame_at(NOW_NS))
    memory.write(some(memory.due(NOW_NS)))
    assert "signing times not stored" in capsys.readouterr().err
    assert os.listdir(tmp_path) == ["file"]
