"""Starting processes from the nursery, and without it."""

import ctypes
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import made
import pytest
from some import some
from until import until

from uavrt.config.settings import DetectionSettings
from uavrt.core.errors import TunerError
from uavrt.drone.ipc.parent import adopt_orphans
from uavrt.drone.supervisor.mission.search_planning import TuningRequest, request_tuning
from uavrt.drone.supervisor.start.launcher import Launcher

PR_SET_CHILD_SUBREAPER = 36
STAND_IN = """
import os, sys, time

def main():
    place = int(sys.argv[1])
    with open("/proc/self/cmdline", "rb") as file:
        words = file.read().rstrip(b"\\0").split(b"\\0")
    with open("/proc/self/comm") as file:
        name = file.read().strip()
    os.write(place, b"through the descriptor")
    print(os.getpgrp() == os.getpid(), os.environ["COLOUR"], b" ".join(words[1:4]).decode(),
          name if "forked" in sys.argv else "", flush=True)
    sys.stderr.write("and an error\\n")
    if "stays" in sys.argv:
        from uavrt.drone.ipc.parent import die_with_parent
        die_with_parent()  # as every process of the table does
        print("staying", flush=True)
        time.sleep(600.0)
    sys.exit(7)

if __name__ == "__main__":
    main()
"""


@pytest.fixture
def launcher(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Launcher]:
    """Make a launcher whose processes can import a stand-in; we adopt what it forks."""
    (tmp_path / "stand_in.py").write_text(STAND_IN)
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    monkeypatch.setenv("PYTHONPATH", path)
    # A nursery on a busy computer is waited for.
    for name in ("ANSWER_S", "PING_S", "SILENCE_S"):
        monkeypatch.setattr(f"uavrt.drone.supervisor.start.launcher.{name}", 60.0)
    adopt_orphans()
    launcher = Launcher()
    yield launcher
    launcher.close()
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0)


def ready(launcher: Launcher) -> None:
    """Wait for the nursery's imports."""
    launcher.warm_up()
    until(lambda: launcher.tend() or not launcher.importing)


class Started:
    """A stand-in that was started, and what it says."""

    def __init__(self, launcher: Launcher, *arguments: str) -> None:
        output, theirs = os.pipe()
        self._through, passed = os.pipe()
        self.pid = launcher.start(
            "stand_in",
            name="stand-in-1",
            output=theirs,
            fds=(passed,),
            environment={"COLOUR": "green"},
            arguments=(str(passed), *arguments),
        )
        os.close(theirs)
        os.close(passed)
        self._output = os.fdopen(output, "rb")

    def first_line(self) -> str:
        return self._output.readline().decode().strip()

    def end(self) -> tuple[int, str, str]:
        """Wait for it; get its exit code, the rest of its words, what came through."""
        rest = self._output.read().decode().strip()
        through = os.read(self._through, 100).decode()
        _, status = os.waitpid(self.pid, 0)
        self.close()
        return os.waitstatus_to_exitcode(status), rest, through

    def close(self) -> None:
        self._output.close()
        os.close(self._through)


def test_where_orphans_are_not_adopted_processes_are_executed(launcher: Launcher) -> None:
    """An emulator knows no PR_SET_CHILD_SUBREAPER: nobody could wait for what is forked."""
    ready(launcher)
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0)
    executed = Started(launcher, "forked")
    assert executed.first_line().startswith("True green -P -m stand_in ")
    code, _, through = executed.end()  # waits for it
    assert (code, through) == (7, "through the descriptor")


def test_a_forked_process_is_like_an_executed_one(launcher: Launcher) -> None:
    executed = Started(launcher)
    assert executed.first_line() == "True green -P -m stand_in"
    ready(launcher)
    forked = Started(launcher, "forked")
    assert forked.first_line() == "True green -P -m stand_in stand-in-1"
    outcome = (7, "and an error", "through the descriptor")
    assert executed.end() == outcome
    assert forked.end() == outcome


def test_the_death_of_the_nursery_ends_nobody_and_stops_no_start(launcher: Launcher) -> None:
    ready(launcher)
    first = Started(launcher, "forked", "stays")
    first.first_line()
    nursery = some(launcher.pid)
    os.kill(nursery, signal.SIGKILL)
    second = Started(launcher)
    assert second.first_line().startswith("True green")
    assert second.end()[0] == 7
    until(lambda: launcher.tend() == "was killed (signal 9)")
    assert os.waitpid(first.pid, os.WNOHANG) == (0, 0)
    # It is started again by itself.
    until(lambda: launcher.tend() or launcher.pid)
    assert launcher.pid not in (None, nursery)
    assert launcher.restarts == 1
    os.kill(first.pid, signal.SIGKILL)
    assert first.end()[0] == -signal.SIGKILL


def test_a_nursery_that_does_not_answer_is_given_up(
    launcher: Launcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready(launcher)
    monkeypatch.setattr("uavrt.drone.supervisor.start.launcher.ANSWER_S", 0.5)
    os.kill(some(launcher.pid), signal.SIGSTOP)
    process = Started(launcher)
    assert process.first_line().startswith("True green")
    assert process.end()[0] == 7
    until(launcher.tend)  # it was killed


def test_what_is_forked_after_the_supervisor_gave_up_never_runs(
    launcher: Launcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready(launcher)
    answer = launcher._answer

    def late() -> None:
        assert answer() is not None  # it was forked
        time.sleep(0.1)  # and could run, if it would not ask

    monkeypatch.setattr(launcher, "_answer", late)
    process = Started(launcher)
    assert process.first_line() == "True green -P -m stand_in"
    assert process.end() == (7, "and an error", "through the descriptor")


SUPERVISOR = """
import os, signal, sys, time
from uavrt.drone.ipc.parent import PARENT_VARIABLE, adopt_orphans
from uavrt.drone.supervisor.start.launcher import Launcher

adopt_orphans()
launcher = Launcher()
launcher.warm_up()
while launcher.importing:
    launcher.tend()
    time.sleep(0.01)
launcher.start(
    "stand_in", name="x", output=1, fds=(2,), arguments=("2", "forked", "stays"),
    environment={"COLOUR": "green", PARENT_VARIABLE: str(os.getpid())},
)
time.sleep(600.0)
"""


@pytest.mark.usefixtures("launcher")  # for the path
def test_what_is_forked_dies_with_the_supervisor() -> None:
    supervisor = subprocess.Popen(
        [sys.executable, "-c", SUPERVISOR], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    with some(supervisor.stdout) as output:
        while output.readline().strip() != b"staying":
            assert supervisor.poll() is None
        supervisor.kill()
        supervisor.wait()
        # The end comes when nobody holds the other end any more.
        assert select.select([output], [], [], 20.0)[0]
        assert output.read() == b""


def test_the_tuner_answers_from_the_nursery_as_without_it(launcher: Launcher) -> None:
    tags = tuple(
        made.tag(2 * n, hz, 1.3) for n, hz in enumerate((148.61e6, 148.7e6, 148.73e6), 1)
    )
    question = TuningRequest(
        tags=tags, sample_rate_hz=3e6, detection=DetectionSettings(), spare_cores=1
    )
    executed = request_tuning(question)
    ready(launcher)
    assert request_tuning(question, launcher) == executed
    with pytest.raises(TunerError, match="Hz is the widest"):
        request_tuning(
            replace(question, detection=DetectionSettings(frequency_window_hz=5e3)), launcher
        )
