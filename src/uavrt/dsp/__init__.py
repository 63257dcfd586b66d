"""Signal processing: arrays in, arrays out.

`FrontEnd` turns the radio's blocks into tag channels, with a `Decimator` and a `Channelizer`.
`tune` chooses the radio's frequency.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.dsp.block_times import BlockTimes
    from uavrt.dsp.carriers import Carriers
    from uavrt.dsp.channelizer import Channelizer
    from uavrt.dsp.clipping import ClippedTimes, Clipping
    from uavrt.dsp.decimator import Decimator
    from uavrt.dsp.fourier import transform_columns
    from uavrt.dsp.frontend import FrontEnd
    from uavrt.dsp.input_check import InputCheck
    from uavrt.dsp.plan import FrontEndPlan, channel_center_hz
    from uavrt.dsp.sliding_medians import medians
    from uavrt.dsp.tuner import TunerPlan, tune

__all__ = [
    "BlockTimes",
    "Carriers",
    "Channelizer",
    "ClippedTimes",
    "Clipping",
    "Decimator",
    "FrontEnd",
    "FrontEndPlan",
    "InputCheck",
    "TunerPlan",
    "channel_center_hz",
    "medians",
    "transform_columns",
    "tune",
]
__getattr__ = lazily(
    __name__,
    {
        "BlockTimes": "block_times",
        "Carriers": "carriers",
        "Channelizer": "channelizer",
        "ClippedTimes": "clipping",
        "Clipping": "clipping",
        "Decimator": "decimator",
        "FrontEnd": "frontend",
        "FrontEndPlan": "plan",
        "InputCheck": "input_check",
        "TunerPlan": "tuner",
        "channel_center_hz": "plan",
        "medians": "sliding_medians",
        "transform_columns": "fourier",
        "tune": "tuner",
    },
)
