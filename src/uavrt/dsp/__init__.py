"""Signal processing from arrays to arrays, without files or sockets.

`FrontEnd` converts the radio's sample blocks to tag channels; `tune` chooses the radio's
frequency.
"""

from typing import TYPE_CHECKING

from uavrt.core.runtime.lazy import lazily

if TYPE_CHECKING:
    from uavrt.dsp.carriers import Carriers as Carriers
    from uavrt.dsp.channelizer import Channelizer as Channelizer
    from uavrt.dsp.clipping import ClippedTimes as ClippedTimes
    from uavrt.dsp.clipping import Clipping as Clipping
    from uavrt.dsp.decimator import Decimator as Decimator
    from uavrt.dsp.frontend import FrontEnd as FrontEnd
    from uavrt.dsp.plan import FrontEndPlan as FrontEndPlan
    from uavrt.dsp.plan import channel_center_hz as channel_center_hz
    from uavrt.dsp.tuner import TunerPlan as TunerPlan
    from uavrt.dsp.tuner import tune as tune

__all__, __getattr__ = lazily(
    __name__,
    {
        "carriers": "Carriers",
        "channelizer": "Channelizer",
        "clipping": "ClippedTimes Clipping",
        "decimator": "Decimator",
        "frontend": "FrontEnd",
        "plan": "FrontEndPlan channel_center_hz",
        "tuner": "TunerPlan tune",
    },
)
