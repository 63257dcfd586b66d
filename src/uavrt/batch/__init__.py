"""Search whole archives of recordings for one tag list, write Parquet tables, and query them.

`recordings` finds recordings, `copies` excludes second copies, and `names` gives each flight a
unique name. `cells` divides a recording, `cell_work` detects in a cell, and `detecting`
combines cells into recordings. `flight_work` computes poses, bearings and positions of one
flight's pulses, `placing` of all. `workers` runs tasks in parallel, `tables` writes Parquet,
`ledger` records finished work, and `run` controls it all. `questions` runs queries, and
`flight_search` finds flights.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.batch.exporting import export_archive as export_archive
    from uavrt.batch.exporting import survey_of as survey_of
    from uavrt.batch.flight_search import find_flights as find_flights
    from uavrt.batch.questions import ask as ask
    from uavrt.batch.recordings import find_recordings as find_recordings
    from uavrt.batch.run import run_batch as run_batch

__all__, __getattr__ = lazily(
    __name__,
    {
        "exporting": "export_archive survey_of",
        "flight_search": "find_flights",
        "questions": "ask",
        "recordings": "find_recordings",
        "run": "run_batch",
    },
)
