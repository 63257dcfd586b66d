"""Put the samples of a channel in order, clean them, and measure pulses in them.

`block_order` sorts blocks, `samples` buffers the recent ones and their gaps,
`signal_cleaning` and `carrier_lines` remove impulses and carriers, `whitening` and `sparks`
make the noise white and steady, `occupancy` measures how much of the time a frequency is
usable, `refine` measures a pulse.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.detection.signal.block_order import Intake, LongestBlock
    from uavrt.detection.signal.frequency_circle import EDGE_HZ, apart_hz, in_channel_hz
    from uavrt.detection.signal.occupancy import Occupancy
    from uavrt.detection.signal.refine import TRACK_BAND_HZ, Measured, Refiner, timing_error_s
    from uavrt.detection.signal.samples import Counters, SampleBuffer
    from uavrt.detection.signal.signal_cleaning import Cleaner
    from uavrt.detection.signal.sparks import SparkLimiter
    from uavrt.detection.signal.whitening import Whitener

__all__ = [
    "EDGE_HZ",
    "TRACK_BAND_HZ",
    "Cleaner",
    "Counters",
    "Intake",
    "LongestBlock",
    "Measured",
    "Occupancy",
    "Refiner",
    "SampleBuffer",
    "SparkLimiter",
    "Whitener",
    "apart_hz",
    "in_channel_hz",
    "timing_error_s",
]
__getattr__ = lazily(
    __name__,
    {
        "Cleaner": "signal_cleaning",
        "Counters": "samples",
        "EDGE_HZ": "frequency_circle",
        "Intake": "block_order",
        "LongestBlock": "block_order",
        "Measured": "refine",
        "Occupancy": "occupancy",
        "Refiner": "refine",
        "SampleBuffer": "samples",
        "SparkLimiter": "sparks",
        "TRACK_BAND_HZ": "refine",
        "Whitener": "whitening",
        "apart_hz": "frequency_circle",
        "in_channel_hz": "frequency_circle",
        "timing_error_s": "refine",
    },
)
