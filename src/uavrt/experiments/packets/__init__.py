"""The thesis's §5.3: is every pulse that the drone logs received on the ground?"""

from uavrt.experiments.packets.flight import fly
from uavrt.experiments.packets.matching import Match, match_logs, read_log
from uavrt.experiments.packets.model import ModelRow, model_rows

__all__ = ["Match", "ModelRow", "fly", "match_logs", "model_rows", "read_log"]
