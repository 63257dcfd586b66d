"""Stand-in for ``rtl_sdr``: air.py SCENARIO FREQUENCY_HZ RATE_HZ, samples to standard output.

The world as it is now, in real time, in unsigned bytes. The rate of a small dongle is a twelfth
of an Airspy's: what an emulator can take beside everything else.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np

from uavrt.core.clock import Clock
from uavrt.simulation.scene.scenario_file import load_scenario
from uavrt.simulation.synthesis import IQSynthesizer

BLOCK = 8192
LOUDER = 10.0
"""The scenario's noise is a two-hundredth of full scale, less than a step of a byte."""


def main() -> None:
    """Write until nobody reads."""
    scenario, frequency, rate = sys.argv[1:4]
    air = IQSynthesizer(load_scenario(Path(scenario)), float(frequency), float(rate))
    clock = Clock.start()
    index = air.index_at(clock.now_ns())
    while True:
        parts = air.block(index, BLOCK).view(np.float32)
        levels = np.clip(np.rint(parts * (LOUDER * 127.5) + 127.5), 0.0, 255.0)
        index += BLOCK
        time.sleep(max(0.0, (air.time_ns_at(index) - clock.now_ns()) * 1e-9))
        data = memoryview(levels.astype(np.uint8)).cast("B")
        while data:
            data = data[os.write(sys.stdout.fileno(), data) :]


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:
        os._exit(1)
