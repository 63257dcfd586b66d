"""Ask the tuner, in a short-lived process: ``python -m uavrt.supervisor.mission.tuning``.

The tuner needs NumPy and SciPy, which would double the supervisor's memory for a calculation
of 10 ms at each start of a flight. The nursery has them: from there it takes 20 ms.
"""

import json
import os
import select
import signal
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from uavrt.errors import TunerError, UavrtError
from uavrt.supervisor.tree import Launcher

TIMEOUT_S = 10.0
"""The calculation takes 10 ms, the imports 0.3 s; on a busy small computer ten times that."""


@dataclass(frozen=True, slots=True)
class Tuning:
    """The tuner's answer."""

    center_frequency_hz: float
    warnings: tuple[str, ...]


def ask_tuner(
    frequencies_hz: Sequence[float], sample_rate_hz: float, launcher: Launcher | None = None
) -> Tuning:
    """Get the radio frequency that serves all the tags.

    Raises
    ------
    TunerError
        There is none, or the tuner did not answer; the text says why.
    """
    question = json.dumps([list(frequencies_hz), sample_rate_hz])
    try:
        answer = json.loads(_answer(question, launcher or Launcher()))
    except (OSError, ValueError) as error:
        raise TunerError(
            f"the tuner did not answer ({type(error).__name__})",
            remedy="Set radio.center_frequency_hz",
        ) from error
    if "error" in answer:
        raise TunerError(answer["error"])
    return Tuning(float(answer["center_frequency_hz"]), tuple(answer["warnings"]))


def _answer(question: str, launcher: Launcher) -> bytes:
    """Run this module as a program; get what it prints."""
    reader, writer = os.pipe()
    try:
        pid = launcher.start(
            __name__,
            name="tuner",
            output=writer,
            fds=(),
            environment={},
            arguments=(question,),
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
    """Read until the end, or raise TimeoutError."""
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
    """Answer the question of the command line on standard output."""
    from uavrt.dsp import tune
    from uavrt.ipc import die_with_parent

    die_with_parent()
    frequencies_hz, sample_rate_hz = json.loads(sys.argv[1])
    try:
        plan = tune(frequencies_hz, sample_rate_hz=sample_rate_hz)
    except UavrtError as error:
        answer: dict[str, object] = {"error": str(error)}
    else:
        answer = {
            "center_frequency_hz": plan.center_frequency_hz,
            "warnings": plan.warnings,
        }
    sys.stdout.write(json.dumps(answer))


if __name__ == "__main__":
    main()
