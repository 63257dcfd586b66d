"""Tests the radio in a short-lived process: ``python -m
uavrt.drone.supervisor.mission.radio_check``.

The process is separate, because the radio module loads NumPy and the radio's program may hang.
"""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress

import msgspec

from uavrt.config.settings import RadioSettings
from uavrt.core.errors import UavrtError
from uavrt.drone.ipc.parent import PARENT_VARIABLE, die_with_parent

TIMEOUT_S = 7.5
"""Longest wait for the radio test [s]. The ground station waits 8 s; a radio takes 4 s."""


class RadioTest:
    """Starts a radio test in a child process; `answer` then waits for its result."""

    def __init__(self, settings: RadioSettings) -> None:
        question = msgspec.json.encode(settings).decode()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, question],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | {PARENT_VARIABLE: str(os.getpid())},
            process_group=0,
        )

    @property
    def pid(self) -> int:
        """Process id of the child process that tests the radio."""
        return self._process.pid

    def stop(self) -> None:
        """Kill the test, because a flight needs the radio; `answer` then reports a failure."""
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)

    def answer(self) -> tuple[bool, str]:
        """Wait for the result; return whether the radio works, and a text."""
        try:
            output, _ = self._process.communicate(timeout=TIMEOUT_S)
            answer = json.loads(output)
        except (OSError, subprocess.TimeoutExpired, ValueError) as error:
            return False, f"the radio could not be checked ({type(error).__name__}): try again"
        finally:
            # With the radio's program, which would block the radio.
            self.stop()
            self._process.wait()
            if self._process.stdout is not None:
                self._process.stdout.close()
        return bool(answer["found"]), str(answer["text"])


def main() -> None:
    """Test the radio described by the JSON argument; print the result."""
    from uavrt.radio.checking import check_device

    die_with_parent()
    settings = msgspec.json.decode(sys.argv[1], type=RadioSettings)
    try:
        answer = {"found": True, "text": check_device(settings)}
    except UavrtError as error:
        answer = {"found": False, "text": str(error)}
    sys.stdout.write(json.dumps(answer))


if __name__ == "__main__":
    main()
