"""Search whole archives of recordings for the tags of one list, write the results as Parquet
tables, and query them.

`recordings` finds recordings, `copies` excludes second copies of a flight, and `names` gives
each flight a unique name. `steps/recording_cells` divides a recording into time spans (cells),
`steps/cell_work` detects pulses in a cell, and `steps/detecting` combines the results of a
recording's cells. `steps/flight_work` computes poses, bearings and positions from one flight's
pulses, and `steps/flight_placing` plans this for all flights. `steps/workers` runs tasks in
parallel, `parquet/parquet_tables` writes Parquet files, and `parquet/ledger` records finished
work. `batch_run` runs these steps in order. `parquet/questions` runs queries, and
`parquet/flight_search` finds flights.
"""

from typing import TYPE_CHECKING

from uavrt.core.runtime.lazy import lazily

if TYPE_CHECKING:
    from uavrt.analysis.archive.batch_run import run_batch as run_batch
    from uavrt.analysis.archive.exporting import export_archive as export_archive
    from uavrt.analysis.archive.exporting import survey_of as survey_of
    from uavrt.analysis.archive.parquet.flight_search import find_flights as find_flights
    from uavrt.analysis.archive.parquet.questions import ask as ask
    from uavrt.analysis.archive.recordings import find_recordings as find_recordings

__all__, __getattr__ = lazily(
    __name__,
    {
        "exporting": "export_archive survey_of",
        "parquet.flight_search": "find_flights",
        "parquet.questions": "ask",
        "recordings": "find_recordings",
        "batch_run": "run_batch",
    },
)
