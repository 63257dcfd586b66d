"""Signal processing: arrays in, arrays out.

`FrontEnd` takes a radio's blocks to the channels of the tags; it is made of `Decimator` and
`Channelizer`. `tune` chooses the radio's frequency.
"""

from uavrt.dsp.carriers import Carriers
from uavrt.dsp.channelizer import Channelizer
from uavrt.dsp.clipping import ClippedTimes, Clipping
from uavrt.dsp.decimator import Decimator
from uavrt.dsp.frontend import FrontEnd
from uavrt.dsp.plan import FrontEndPlan
from uavrt.dsp.tuner import TunerPlan, tune

__all__ = [
    "Carriers",
    "Channelizer",
    "ClippedTimes",
    "Clipping",
    "Decimator",
    "FrontEnd",
    "FrontEndPlan",
    "TunerPlan",
    "tune",
]
