"""Ask the tuner, in a short-lived process: ``python -m uavrt.supervisor.tuning``.

The tuner needs NumPy and SciPy, which would double the supervisor's memory for a calculation
of 10 ms at each start of a flight.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from uavrt.errors import TunerError, UavrtError

TIMEOUT_S = 10.0
"""The calculation takes 10 ms, the imports 0.3 s; on a busy small computer ten times that."""


@dataclass(frozen=True, slots=True)
class Tuning:
    """The tuner's answer."""

    center_frequency_hz: float
    warnings: tuple[str, ...]


def ask_tuner(frequencies_hz: Sequence[float], sample_rate_hz: float) -> Tuning:
    """Get the radio frequency that serves all the tags.

    Raises
    ------
    TunerError
        There is none, or the tuner did not answer; the text says why.
    """
    question = json.dumps([list(frequencies_hz), sample_rate_hz])
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
        raise TunerError(
            f"the tuner did not answer ({type(error).__name__})",
            remedy="Set radio.center_frequency_hz",
        ) from error
    if "error" in answer:
        raise TunerError(answer["error"])
    return Tuning(float(answer["center_frequency_hz"]), tuple(answer["warnings"]))


def main() -> None:
    """Answer the question of the command line on standard output."""
    from uavrt.dsp.tuner import tune

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
