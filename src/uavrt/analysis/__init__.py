"""Turn recordings and flights into results: bearings, positions, reports and exports.

`survey` reads a flight or a pulse log with all its estimates; `estimates/bearings`,
`estimates/positions` and `whole_flights/judged_flights` compute single steps. `measure`
analyses recordings, and `tracks` reads logs of autopilots. `export` and `report` write results,
and `covered/coverage_maps` maps where a tag would have been detected.
"""

from typing import TYPE_CHECKING

from uavrt.core.runtime.lazy import lazily

if TYPE_CHECKING:
    from uavrt.analysis.integrated.integrated_records import (
        IntegratedRecord as IntegratedRecord,
    )
    from uavrt.analysis.survey import read_survey as read_survey

__all__, __getattr__ = lazily(
    __name__, {"integrated.integrated_records": "IntegratedRecord", "survey": "read_survey"}
)
