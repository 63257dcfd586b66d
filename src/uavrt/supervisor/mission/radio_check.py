"""Checks the radio: ``python -m uavrt.supervisor.mission.radio_check``, a short-lived process.

The module of the radios needs NumPy, and the radio's program may hang.
"""

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress

import msgspec

from uavrt.config.settings import RadioSettings
from uavrt.errors import UavrtError
from uavrt.ipc.parent import PARENT_VARIABLE, die_with_parent

TIMEOUT_S = 7.5
"""Longest query [s]; the ground station waits 8 s, a radio that works answers within 4."""


class RadioQuestion:
    """A query in progress.

    Create it where children are tracked, so that it does not count as an orphan, and wait for
    its answer in a thread. Raises `OSError` if the system has no room for another process.
    """

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
        """Its process id."""
        return self._process.pid

    def stop(self) -> None:
        """End it, because a flight starts and needs the radio; its answer says so."""
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)

    def answer(self) -> tuple[bool, str]:
        """Wait some seconds for the result: whether the radio is there, and a text."""
        try:
            output, _ = self._process.communicate(timeout=TIMEOUT_S)
            answer = json.loads(output)
        except (OSError, subprocess.TimeoutExpired, ValueError) as error:
            return False, f"the radio was not asked ({type(error).__name__}): try again"
        finally:
            # With the radio's program, which would block the radio.
            self.stop()
            self._process.wait()
            if self._process.stdout is not None:
                self._process.stdout.close()
        return bool(answer["found"]), str(answer["text"])


def main() -> None:
    """Run the query of the command line; print the answer."""
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
