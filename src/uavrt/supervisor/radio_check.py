"""Is the radio there? ``python -m uavrt.supervisor.radio_check``, a short-lived process.

The module of the radios needs NumPy, and the radio's information program may hang.
"""

import json
import subprocess
import sys

import msgspec

from uavrt.config.settings import RadioSettings
from uavrt.errors import UavrtError

TIMEOUT_S = 10.0


def ask_radio(settings: RadioSettings) -> tuple[bool, str]:
    """Get whether the radio is there, and what to say of it; takes up to ten seconds."""
    question = msgspec.json.encode(settings).decode()
    try:
        finished = subprocess.run(
            [sys.executable, "-m", __name__, question],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
        )
        answer = json.loads(finished.stdout)
    except (OSError, subprocess.TimeoutExpired, ValueError) as error:
        return False, f"the radio was not asked ({type(error).__name__}): try again"
    return bool(answer["found"]), str(answer["text"])


def main() -> None:
    """Answer the question of the command line on standard output."""
    from uavrt.radio import check_device

    settings = msgspec.json.decode(sys.argv[1], type=RadioSettings)
    try:
        said = check_device(settings)
        answer = {"found": True, "text": said.splitlines()[0] if said else settings.kind}
    except UavrtError as error:
        answer = {"found": False, "text": str(error)}
    sys.stdout.write(json.dumps(answer))


if __name__ == "__main__":
    main()
