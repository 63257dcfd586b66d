"""Turn recordings and flights into results: bearings, positions, reports and exports.

`survey` reads a flight or an archive with all its estimates; `bearings`, `positions` and
`whole_flight` are single steps. `measure` works on recordings, and `tracks` reads logs of
autopilots. `export` and `report` write results, and `coverage` maps where a tag would have been
detected.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.analysis.integrated_records import IntegratedRecord as IntegratedRecord
    from uavrt.analysis.survey import read_survey as read_survey

__all__, __getattr__ = lazily(
    __name__, {"integrated_records": "IntegratedRecord", "survey": "read_survey"}
)
