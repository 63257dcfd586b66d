"""Processes that fail in their own ways, under the fleet: real children, no radio."""

import asyncio
import ctypes
import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager
from dataclasses import replace
from pathlib import Path

import made
import pytest
from some import some

from uavrt.config.ghost_places import Receiver
from uavrt.config.settings import RecordingSettings, Settings
from uavrt.core.messages import Tag
from uavrt.drone.ipc.parent import adopt_orphans
from uavrt.drone.supervisor.mission.flight_opening import share_tags
from uavrt.drone.supervisor.start.launcher import Launcher
from uavrt.drone.supervisor.start.restarts import FLIGHT_RESTARTS
from uavrt.drone.supervisor.start.usage import children_of
from uavrt.drone.supervisor.tree.child_output import OutputLog, warning_text
from uavrt.drone.supervisor.tree.instance import Instance
from uavrt.drone.supervisor.tree.process_tree import ProcessTree
from uavrt.drone.supervisor.tree.table import ProcessRow, always
from uavrt_experiments.resources.usage import is_alive

PR_SET_CHILD_SUBREAPER = 36
FAILING = """
import sys
from uavrt.core.log import configure_logging
from uavrt.core.log import get_logger

def main():
    configure_logging("failing")
    get_logger().info("starting")
    get_logger().error("the antenna has fallen off", where="field")
    sys.exit(3)
"""
SILENT = """
import time
from uavrt.drone.ipc.process import ProcessFrame

def main():
    with ProcessFrame.start() as frame:
        frame.report("speaking for the last time")
        while True:
            time.sleep(60.0)
"""
MUTE = "import time\ndef main():\n    time.sleep(600.0)\n"
DEAF = """
import signal, subprocess, sys, time
from uavrt.drone.ipc.process import ProcessFrame

def main():
    with ProcessFrame.start() as frame:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
        while True:
            frame.report("deaf")
            time.sleep(0.05)
"""
SLEEP = "import time; time.sleep(600)"
LEAVE = f"""
import subprocess, sys
left = subprocess.Popen([sys.executable, "-c", {SLEEP!r}], stdout=subprocess.DEVNULL)
left.returncode = 0
print(left.pid)
"""
MAIN = "\nif __name__ == '__main__':\n    main()\n"
ROW = ProcessRow(
    name="process",
    module="",
    meaning="a stand-in",
    runs=always,
    consumes=(),
    produces=("health", "status_text"),
    cpu_budget_percent=5.0,
    memory_limit_mb=100.0,
)


class Yard:
    """A fleet of one process, and all it says."""

    def __init__(self, directory: Path, row: ProcessRow) -> None:
        self.texts: list[tuple[int, str]] = []
        self.records: list[bytes] = []
        self.output = OutputLog(directory)
        self.wake = asyncio.Event()
        settings = Settings(recording=RecordingSettings(directory=str(directory)))
        mission = made.mission(settings, directory, notify=self._notify)
        # A nursery that never comes: processes are executed.
        launcher = Launcher()
        launcher.tend = lambda: None  # type: ignore[method-assign]
        self.process_tree = ProcessTree(
            [row],
            mission,
            launcher=launcher,
            workers=1,
            notify=self._notify,
            on_line=lambda _instance, line: self.records.append(line),
            on_output=self._on_output,
            wake=self.wake.set,
        )
        self.instance = self.process_tree.instance_of(row)

    def _notify(self, severity: int, text: str) -> None:
        self.texts.append((severity, text))

    def _on_output(self, instance: Instance, line: bytes) -> None:
        self.output.write(instance.name, line)
        text = warning_text(instance.name, line)
        if text is not None:
            instance.last_error = text.text

    async def until(self, condition: Callable[[], object]) -> None:
        """Let the fleet work until something is so."""
        deadline_s = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < deadline_s, self.texts
            self.process_tree.ensure()
            await asyncio.sleep(0.02)


@contextmanager
def importable(directory: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    (directory / "stand_in_process.py").write_text(text + MAIN)
    path = [str(directory), *filter(None, [os.environ.get("PYTHONPATH")])]
    with monkeypatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join(path))
        yield "stand_in_process"


Run = Callable[[str, ProcessRow], AbstractAsyncContextManager[Yard]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Run]:
    """Run a process of a text while a block lasts, and end what it left."""

    @asynccontextmanager
    async def running(text: str, row: ProcessRow) -> AsyncIterator[Yard]:
        with importable(tmp_path, text, monkeypatch) as module:
            yard = Yard(tmp_path, replace(row, module=module))
            try:
                yield yard
            finally:
                await yard.process_tree.stop_all()

    adopt_orphans()
    yield running
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0)


async def test_a_process_that_keeps_ending_is_degraded_and_the_ground_reads_why(
    run: Run, tmp_path: Path
) -> None:
    # However long a busy computer takes for each start, the ends are in a row.
    patient = replace(FLIGHT_RESTARTS, settled_s=100.0)
    async with run(FAILING, replace(ROW, restart=patient)) as yard:
        await yard.until(
            lambda: yard.instance.restarts.in_a_row >= FLIGHT_RESTARTS.degraded_after
        )
        severity, text = yard.texts[-1]
        assert severity == 3
        assert text.startswith(
            f"process degraded: ended {FLIGHT_RESTARTS.degraded_after} times in a row"
        )
        assert "ended (exit 3)" in text
        assert "the antenna has fallen off (where field)" in text
        assert yard.instance.status().status.startswith("degraded: ended (exit 3)")
        assert not yard.instance.status().ok
        # Each end before that was told as well.
        assert len(yard.texts) == FLIGHT_RESTARTS.degraded_after
        # It is still tried.
        await yard.until(lambda: yard.instance.restarts.total > FLIGHT_RESTARTS.degraded_after)
    # All that it printed is kept, each line with its time.
    lines = (tmp_path / "system_log/process.log").read_text().splitlines()
    assert sum('"starting"' in line for line in lines) > FLIGHT_RESTARTS.degraded_after
    assert all(line[:2] == "20" and line[19] == "Z" for line in lines)


async def test_a_process_that_falls_silent_is_killed_and_comes_back(run: Run) -> None:
    async with run(SILENT, replace(ROW, silence_limit_s=0.3)) as yard:
        await yard.until(lambda: yard.records)
        assert yard.instance.child is not None
        first = yard.instance.child.pid
        await yard.until(lambda: yard.instance.child and yard.instance.child.pid != first)
        assert not is_alive(first)
        severity, text = yard.texts[0]
        assert severity == 4
        assert text.startswith("process was killed (SIGKILL): silent for ")


async def test_a_detector_s_status_names_the_tags_that_it_was_started_with(run: Run) -> None:
    async with run(SILENT, replace(ROW, produces=("health", "search_report"))) as yard:
        yard.process_tree._mission.upload.begin([made.tag(tag_id, 148e6) for tag_id in (2, 4)])
        await yard.until(lambda: yard.records)
        assert yard.instance.status().tag_ids == (2, 4)


async def test_a_stopped_process_is_killed_without_being_asked_to_end(run: Run) -> None:
    async with run(DEAF, replace(ROW, silence_limit_s=0.5)) as yard:
        await yard.until(lambda: yard.records)
        assert yard.instance.child is not None
        first = yard.instance.child.pid
        os.kill(first, signal.SIGSTOP)
        await yard.until(lambda: yard.instance.child and yard.instance.child.pid != first)
        assert not is_alive(first)


async def test_a_process_that_never_says_a_word_is_killed_too(run: Run) -> None:
    async with run(MUTE, replace(ROW, start_limit_s=0.5)) as yard:
        await yard.until(lambda: yard.instance.restarts.total)
        assert "SIGKILL" in yard.texts[0][1]


async def test_what_does_not_heed_sigterm_is_killed_with_all_it_started(run: Run) -> None:
    async with run(DEAF, replace(ROW, stop_timeout_s=0.3)) as yard:
        await yard.until(lambda: yard.records)
        pid = some(yard.instance.child).pid
        await yard.until(lambda: children_of(pid))
        grandchildren = children_of(pid)
        await yard.process_tree.stop_all()
        assert yard.texts == [(4, "process did not stop: killed")]
        assert not is_alive(pid)
        await yard.until(lambda: not any(map(is_alive, grandchildren)))


def start(text: str) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True)


def leave_an_orphan() -> int:
    """Get the id of a process whose parent has ended, and nobody of the table with it."""
    with start(LEAVE) as parent:
        return int(some(parent.stdout).read())


async def test_an_orphan_is_ended_at_once_and_a_child_that_is_spared_is_not(run: Run) -> None:
    async with run(DEAF, replace(ROW, stop_timeout_s=0.3)) as yard:
        await yard.until(lambda: yard.records)
        spared = start(SLEEP)
        with yard.process_tree.exempt(spared.pid):
            orphan = leave_an_orphan()
            await yard.until(lambda: orphan not in children_of(os.getpid()))
            assert not is_alive(orphan)
            assert spared.poll() is None
        await yard.until(lambda: not is_alive(spared.pid))
        spared.communicate()
        assert yard.instance.restarts.total == 0


async def test_a_system_without_room_for_a_process_is_asked_again(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> int:
        raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    async with run(DEAF, replace(ROW, stop_timeout_s=0.3)) as yard:
        with monkeypatch.context() as full:
            # As fork(2) fails when the limit of process ids is reached.
            full.setattr(Launcher, "start", refuse)
            await yard.until(lambda: yard.instance.restarts.in_a_row >= 2)
        assert "could not be started (Resource temporarily unavailable)" in yard.texts[0][1]
        await yard.until(lambda: yard.records)


async def test_more_memory_than_the_row_allows_is_reported(run: Run) -> None:
    async with run(DEAF, replace(ROW, memory_limit_mb=1.0, stop_timeout_s=0.3)) as yard:
        await yard.until(lambda: yard.records)
        yard.instance.status()  # measures
        text = some(yard.instance.over_budget(time.monotonic()))
        assert text.startswith("process uses ")
        assert text.endswith("MB (budget 1 MB)")


@pytest.mark.parametrize(
    ("level", "severity"), [("warning", 4), ("error", 3), ("critical", 2), ("info", None)]
)
def test_warnings_and_worse_become_texts_for_the_ground(
    level: str, severity: int | None
) -> None:
    line = f'{{"event": "disk slow", "level": "{level}", "process": "recorder", "ms": 900}}'
    text = warning_text("recorder", line.encode())
    assert (text.severity if text else None) == severity
    if text is not None:
        assert text.text == "recorder: disk slow (ms 900)"


def test_a_traceback_is_no_text_but_is_kept(tmp_path: Path) -> None:
    assert warning_text("recorder", b"Traceback (most recent call last):") is None
    output = OutputLog(tmp_path)
    output.write("recorder", b"Traceback (most recent call last):")
    flight = tmp_path / "flight"
    output.open_flight(flight)
    output.write("recorder", b"in flight")
    output.write("receiver", b'{"event": "radio says", "line": "gain 21", "level": "info"}')
    output.close_flight()
    output.write("recorder", b"after it")
    ground = (tmp_path / "system_log/recorder.log").read_text()
    assert "Traceback" in ground
    assert "after it" in ground
    assert "in flight" in (flight / "process_log/recorder.log").read_text()
    assert "gain 21" in (flight / "airspy_csdr_netcat_log/radio.log").read_text()
    assert output.lost_lines == 0


def test_tags_of_one_band_go_to_one_worker_and_no_worker_is_left_without() -> None:
    def tag(tag_id: int, frequency_hz: float) -> Tag:
        return made.tag(tag_id, frequency_hz)

    apart = tuple(tag(2 * n, 148e6 + 2000.0 * n) for n in range(1, 6))
    assert share_tags(apart, 2, window_hz=500.0) == (apart[::2], apart[1::2])
    near = (tag(2, 148e6), tag(4, 149e6), tag(6, 148e6 + 900.0), tag(8, 148e6 + 1800.0))
    shares = share_tags(near, 3, window_hz=500.0)
    assert shares == ((near[0], near[2], near[3]), (near[1],))
    assert share_tags((), 3, window_hz=500.0) == ((),)


def test_a_tag_and_its_ghosts_places_are_one_workers_while_the_load_is_even() -> None:
    def tag(tag_id: int, offset_hz: float) -> Tag:
        return made.tag(tag_id, 148.7e6 + offset_hz)

    receiver = Receiver(148.7e6, 3e6)
    # Its mirror, a bystander, and where three times the first one's distance is.
    few = (tag(2, 120e3), tag(4, -120.4e3), tag(6, 77e3), tag(8, -360e3))
    shares = share_tags(few, 2, window_hz=1000.0, receiver=receiver)
    assert [sorted(t.tag_id for t in share) for share in shares] == [[2, 4, 8], [6]]
    many = tuple(
        tag(4 * n + 2 * side, (-1.0) ** side * (50e3 + 7_777.0 * n))
        for n in range(1, 51)
        for side in (0, 1)
    )
    shares = share_tags(many, 4, window_hz=1000.0, receiver=receiver)
    worker_of = {t.tag_id: at for at, share in enumerate(shares) for t in share}
    assert sorted(worker_of) == sorted(t.tag_id for t in many)
    assert max(map(len, shares)) <= 1.5 * len(many) / 4
    pairs = [(4 * n, 4 * n + 2) for n in range(1, 51)]
    assert sum(worker_of[a] == worker_of[b] for a, b in pairs) >= 45
