"""Finds the radio frequency in a short-lived process: ``python -m
uavrt.drone.supervisor.mission.search_planning``.

NumPy would double the supervisor's memory for 10 ms of computing at each start of a flight. A
fork of the nursery, which has NumPy loaded, takes 20 ms.
"""

import math
import os
import select
import signal
import sys
import time
from contextlib import suppress
from dataclasses import dataclass

import msgspec

from uavrt.config.settings import DetectionSettings
from uavrt.core.errors import TunerError, UavrtError
from uavrt.core.messages import Tag
from uavrt.drone.supervisor.start.launcher import Launcher

TIMEOUT_S = 15.0
"""Longest wait for the computed radio frequency [s]. Imports take 0.3 s and measuring the cost
of a long list 2 s; on a busy small computer, several times that."""
UNMEASURED_TAGS = 100
"""Number of tags that two cores can always search; the cost of a longer list is measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TuningRequest:
    """Question for a radio frequency: tags, sample rate, and search settings."""

    tags: tuple[Tag, ...]
    sample_rate_hz: float
    detection: DetectionSettings
    center_frequency_hz: float | None = None
    """Frequency set by the operator [Hz]; None if one must be computed."""
    spare_cores: int | None = None
    """Number of cores that the search may use; None: its cost is not checked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """Radio frequency [Hz] with warnings, or the reason why no frequency is suitable."""

    center_frequency_hz: float = 0.0
    warnings: tuple[str, ...] = ()
    error: str = ""


def request_tuning(question: TuningRequest, launcher: Launcher | None = None) -> Tuning:
    """Compute a radio frequency that receives all tags; `TunerError` if none does."""
    try:
        answer = msgspec.json.decode(_answer(question, launcher or Launcher()), type=Tuning)
    except (OSError, ValueError) as error:
        raise TunerError(
            f"the radio frequency could not be computed ({type(error).__name__})",
            remedy="Set radio.center_frequency_hz",
        ) from error
    if answer.error:
        raise TunerError(answer.error)
    return answer


def _answer(question: TuningRequest, launcher: Launcher) -> bytes:
    """Run this module as a program with the request; return its JSON answer."""
    asked = os.memfd_create("question")  # a command line holds 128 kB
    try:
        with open(asked, "wb", closefd=False) as file:
            file.write(msgspec.json.encode(question))
        os.lseek(asked, 0, os.SEEK_SET)
        return _run(asked, launcher)
    finally:
        os.close(asked)


def _run(asked: int, launcher: Launcher) -> bytes:
    reader, writer = os.pipe()
    try:
        pid = launcher.start(
            __name__,
            name="tuner",
            output=writer,
            fds=(asked,),
            environment={},
            arguments=(str(asked),),
        )
    except OSError:
        os.close(reader)
        raise
    finally:
        os.close(writer)
    try:
        return _read_all(reader)
    finally:
        os.close(reader)
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)


def _read_all(descriptor: int) -> bytes:
    deadline_s = time.monotonic() + TIMEOUT_S
    data = b""
    while True:
        left_s = max(0.0, deadline_s - time.monotonic())
        if not select.select([descriptor], [], [], left_s)[0]:
            raise TimeoutError
        part = os.read(descriptor, 65_536)
        if not part:
            return data
        data += part


def main() -> None:
    """Read a request from the file descriptor given as argument; print the answer."""
    from uavrt.core.clock import cpu_s
    from uavrt.detection.search_plan import plan_search
    from uavrt.drone.ipc.parent import die_with_parent

    die_with_parent()
    with open(int(sys.argv[1]), "rb") as file:
        question = msgspec.json.decode(file.read(), type=TuningRequest)
    cores = math.inf if question.spare_cores is None else question.spare_cores
    try:
        plan = plan_search(
            question.tags,
            cpu_s,
            sample_rate_hz=question.sample_rate_hz,
            detection=question.detection,
            center_frequency_hz=question.center_frequency_hz,
            spare_cores=cores,
        )
    except UavrtError as error:
        answer = Tuning(error=str(error))
    else:
        answer = Tuning(center_frequency_hz=plan.center_frequency_hz, warnings=plan.warnings)
    sys.stdout.write(msgspec.json.encode(answer).decode())


if __name__ == "__main__":
    main()
