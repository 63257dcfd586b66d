"""Whole archives of recordings under one tag list, to Parquet, and questions over them.

`recordings` finds what there is, `copies` leaves out what is there twice, and `names` gives
each flight a name of its own. `cells` cuts a recording, `cell_work` detects in a cell and hands
its state on from chunk to chunk (`chain_state`), `detecting` makes recordings of cells again.
`flight_work` makes poses, bearings and positions of a flight's pulses, `placing` of all.
`workers` runs tasks side by side, `tables` writes Parquet, `ledger` knows what is done, `run`
does it all; `questions` asks the tables, `flight_search` finds flights in them.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.batch.cells import Cell, cells_of
    from uavrt.batch.exporting import export_archive, survey_of
    from uavrt.batch.flight_search import ArchivedFlight, FoundFlights, find_flights
    from uavrt.batch.flight_work import PlacingSettings
    from uavrt.batch.questions import QUESTIONS, ask, check_archive
    from uavrt.batch.recordings import Found, Recording, find_recordings, read_manifest
    from uavrt.batch.run import run_batch
    from uavrt.batch.settings import STEPS, USUAL_STEPS, BatchSettings, BatchSummary, BatchWatch
    from uavrt.batch.tables import FlightRow, RecordingRow

__all__ = [
    "QUESTIONS",
    "STEPS",
    "USUAL_STEPS",
    "ArchivedFlight",
    "BatchSettings",
    "BatchSummary",
    "BatchWatch",
    "Cell",
    "FlightRow",
    "Found",
    "FoundFlights",
    "PlacingSettings",
    "Recording",
    "RecordingRow",
    "ask",
    "cells_of",
    "check_archive",
    "export_archive",
    "find_flights",
    "find_recordings",
    "read_manifest",
    "run_batch",
    "survey_of",
]
__getattr__ = lazily(
    __name__,
    {
        "QUESTIONS": "questions",
        "STEPS": "settings",
        "USUAL_STEPS": "settings",
        "ArchivedFlight": "flight_search",
        "BatchSettings": "settings",
        "BatchSummary": "settings",
        "BatchWatch": "settings",
        "Cell": "cells",
        "FlightRow": "tables",
        "Found": "recordings",
        "FoundFlights": "flight_search",
        "PlacingSettings": "flight_work",
        "Recording": "recordings",
        "RecordingRow": "tables",
        "ask": "questions",
        "cells_of": "cells",
        "check_archive": "questions",
        "export_archive": "exporting",
        "find_flights": "flight_search",
        "find_recordings": "recordings",
        "read_manifest": "recordings",
        "run_batch": "run",
        "survey_of": "exporting",
    },
)
