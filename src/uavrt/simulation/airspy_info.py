"""Stand-in for ``airspy_info``: says which simulated device is attached.

``python -m uavrt.simulation.airspy_info [--absent] [-s SERIAL]``
"""

import getopt
import sys
from collections.abc import Sequence

from uavrt.simulation.airspy_rx import NOT_FOUND, SAMPLE_RATES_HZ, SERIAL


def main(arguments: Sequence[str]) -> int:
    """Print the device; the exit code is 1 when there is none, as with the real program."""
    try:
        pairs, _ = getopt.getopt(list(arguments), "s:", ["absent", "world=", "start-time-ns="])
        given = dict(pairs)
        serial = int(given["-s"], 0) if "-s" in given else SERIAL
    except (getopt.GetoptError, ValueError) as error:
        sys.stderr.write(f"unknown argument: {error}\n")
        return 1
    if "--absent" in given or serial != SERIAL:
        sys.stderr.write(f"{NOT_FOUND}\n")
        return 1
    rates = "".join(f"\t{rate / 1e6:.6f} MSPS\n" for rate in SAMPLE_RATES_HZ[:2])
    sys.stdout.write(
        "Found AirSpy board 1\n"
        "Board ID Number: 0 (AIRSPY, simulated)\n"
        f"Serial Number: 0x{SERIAL:016X}\n"
        f"Supported sample rates:\n{rates}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
