"""From recordings and flights to results.

`survey` reads a flight or an archive with all its estimates; `bearings`, `positions` and
`whole_flight` are single steps. `measure` works on recordings, `tracks` reads autopilots' logs;
`export` and `report` write results, `coverage` says what was heard of an area.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.analysis.integrated_records import IntegratedRecord as IntegratedRecord
    from uavrt.analysis.survey import read_survey as read_survey

__all__, __getattr__ = lazily(
    __name__, {"integrated_records": "IntegratedRecord", "survey": "read_survey"}
)
