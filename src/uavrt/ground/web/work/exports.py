"""Export a flight to files for other programs, as ``uavrt export`` does."""

from pathlib import Path

from uavrt.analysis.export.csv_tables import pulses_csv
from uavrt.analysis.export.written import ONE_FILE, OneFile
from uavrt.analysis.survey import read_survey
from uavrt.ground.store.estimates import AntennaChoice

EXPORTS: dict[str, OneFile] = {"csv": OneFile("text/csv", pulses_csv), **ONE_FILE}
"""Export formats that the page offers."""


def export(name: str, flight: Path, antenna: AntennaChoice) -> bytes:
    """Write a flight with its marks in one of the formats of `EXPORTS`."""
    content = EXPORTS[name].content(read_survey(flight, antenna.estimation_options))
    return content if isinstance(content, bytes) else content.encode()
