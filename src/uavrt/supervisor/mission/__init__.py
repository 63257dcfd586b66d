"""What the operator asked for, and which part of it survives a restart.

`orders` holds state, tags and flight, and knows no processes. `saved_state` and
`kept_parameters` are its files; `operations` runs jobs that outlast a command;
`who_commands` refuses strangers' commands and `disk_guard` watches free space.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.supervisor.mission.background import in_background
    from uavrt.supervisor.mission.disk_guard import DiskGuard
    from uavrt.supervisor.mission.flight_opening import share_tags
    from uavrt.supervisor.mission.last_pulses import LastPulses
    from uavrt.supervisor.mission.operations import Operations
    from uavrt.supervisor.mission.orders import Mission, Tell
    from uavrt.supervisor.mission.progress import FlightProgress
    from uavrt.supervisor.mission.radio_check import RadioQuestion
    from uavrt.supervisor.mission.saved_state import (
        LOCK_NAME,
        STATE_NAME,
        SavedState,
        StateStore,
    )
    from uavrt.supervisor.mission.tuning import ask_tuner
    from uavrt.supervisor.mission.wall_clock import WallClockWatch

__all__ = [
    "LOCK_NAME",
    "STATE_NAME",
    "DiskGuard",
    "FlightProgress",
    "LastPulses",
    "Mission",
    "Operations",
    "RadioQuestion",
    "SavedState",
    "StateStore",
    "Tell",
    "WallClockWatch",
    "ask_tuner",
    "in_background",
    "share_tags",
]
__getattr__ = lazily(
    __name__,
    {
        "DiskGuard": "disk_guard",
        "FlightProgress": "progress",
        "LastPulses": "last_pulses",
        "Mission": "orders",
        "Operations": "operations",
        "RadioQuestion": "radio_check",
        "LOCK_NAME": "saved_state",
        "STATE_NAME": "saved_state",
        "SavedState": "saved_state",
        "StateStore": "saved_state",
        "Tell": "orders",
        "WallClockWatch": "wall_clock",
        "ask_tuner": "tuning",
        "in_background": "background",
        "share_tags": "flight_opening",
    },
)
