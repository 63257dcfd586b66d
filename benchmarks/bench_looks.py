"""A flight judged while it is flown: what each look costs, over twenty minutes.

The flight is made minute by minute: noise of one kept channel at 7500 samples a second, poses
of a drone that turns while it flies on. After some of the minutes the tag is judged as the
drone's integrator does, in a process of its own whose memory is read at the end.
"""

import math
import multiprocessing
import resource
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.harness import Table
from uavrt.analysis.integrated.flight_so_far import FlightSoFar
from uavrt.analysis.whole_flights.judged_flights import WholeFlightOptions
from uavrt.core.messages import ChannelBlock, FlightInfo, Pose
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.samples.channel_recorder import ChannelRecorder
from uavrt.localization.antenna import PATTERNS
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG

RATE_HZ = 7500.0
MINUTES = 20
LOOKS = (1, 2, 5, 10, 20)
TURN_DEG_S = 6.0
SPEED_M_S = 1.0
SECOND_NS = 1_000_000_000


def run() -> list[Table]:
    """The one table of this section."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        costs, most_mb, imported_mb = pool.apply(_flown)
    rows = [
        [f"{minute} min", f"{costs[minute]:.2f}", f"{10.0 * costs[minute]:.0f} s"]
        for minute in LOOKS
    ]
    return [
        Table(
            title="A look at one tag, ± 500 Hz, at the flight so far",
            header=["flown", "CPU s", "then again after, at a tenth of a core"],
            rows=rows,
            notes=[
                f"Memory of the process: {most_mb:.0f} MB at most (resident), "
                f"{imported_mb:.0f} MB before the first look."
            ],
        )
    ]


def _flown() -> tuple[dict[int, float], float, float]:
    """CPU seconds of the look after so many minutes, and the most memory [MB]."""
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder) / "flight"
        tag = replace(THESIS_TAG, interval_uncertainty_s=0.060)
        log = FlightRecorder.create(
            FlightInfo(
                directory=str(directory),
                start_time_ns=START_NS,
                clock_offset_ns=0,
                tags=(tag,),
                center_frequency_hz=tag.frequency_hz,
                sample_rate_hz=RATE_HZ,
            ),
            None,
        )
        recorder = ChannelRecorder(directory, budget_mb=1000.0, minimum_free_mb=0.0)
        flight = FlightSoFar(directory, WholeFlightOptions(pattern=PATTERNS["RA-23K"]))
        before_mb = _resident_mb()
        costs = {}
        for minute in range(MINUTES):
            _fly(minute, tag.frequency_hz, log, recorder)
            if minute + 1 in LOOKS:
                began_s = time.process_time()
                flight.search(tag)
                costs[minute + 1] = time.process_time() - began_s
        recorder.close()
        log.close()
        return costs, _resident_mb(), before_mb


def _fly(minute: int, frequency_hz: float, log: FlightRecorder, keep: ChannelRecorder) -> None:
    """Record one minute of noise and poses, and a little of the next for its last block."""
    rng, rate = np.random.default_rng(minute), round(RATE_HZ)
    for second in range(60 * minute, 60 * (minute + 1)):
        samples = rng.standard_normal((rate, 2)).astype(np.float32).view(np.complex64)[:, 0]
        keep.put(
            [
                ChannelBlock(
                    channel=0,
                    center_frequency_hz=frequency_hz,
                    samples=samples,
                    sample_index=second * rate,
                    time_ns=START_NS + second * SECOND_NS,
                    sample_rate_hz=RATE_HZ,
                )
            ]
        )
    wanted = 60 * (minute + 1) * rate
    while keep.written_samples < wanted:
        time.sleep(0.05)
    log.write(*(_pose(tenth / 5.0) for tenth in range(300 * minute, 300 * minute + 300)))
    log.commit()


def _pose(time_s: float) -> Pose:
    half = math.radians(TURN_DEG_S * time_s % 360.0) / 2.0
    return Pose(
        time_ns=START_NS + round(time_s * SECOND_NS),
        latitude_deg=35.0 + SPEED_M_S * time_s / 111_000.0,
        longitude_deg=-111.0,
        altitude_amsl_m=2050.0,
        altitude_relative_m=50.0,
        quaternion_wxyz=(math.cos(half), 0.0, 0.0, math.sin(half)),
    )


def _resident_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
