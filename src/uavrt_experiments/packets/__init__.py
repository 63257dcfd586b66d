"""The thesis's §5.3: is every pulse that the drone logs received on the ground?"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt_experiments.packets.flight import fly
    from uavrt_experiments.packets.matching import Match, match_logs, read_log
    from uavrt_experiments.packets.model import ModelRow, model_rows

__all__ = [
    "Match",
    "ModelRow",
    "fly",
    "match_logs",
    "model_rows",
    "read_log",
]
__getattr__ = lazily(
    __name__,
    {
        "Match": "matching",
        "ModelRow": "model",
        "fly": "flight",
        "match_logs": "matching",
        "model_rows": "model",
        "read_log": "matching",
    },
)
