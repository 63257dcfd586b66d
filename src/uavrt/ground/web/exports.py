"""A flight as files for other programs, by the writers of ``uavrt export``."""

from pathlib import Path

from uavrt.analysis import read_survey
from uavrt.analysis.export import ONE_FILE, OneFile, pulses_csv
from uavrt.ground.store import AntennaChoice
from uavrt.terrain import open_elevation

EXPORTS: dict[str, OneFile] = {
    "csv": OneFile("text/csv", pulses_csv),
    **ONE_FILE,
}
"""Formats that the page offers."""


def export(name: str, flight: Path, antenna: AntennaChoice) -> bytes:
    """Write a flight, with its marks, in one of `EXPORTS`."""
    survey = read_survey(
        flight,
        antenna=antenna.pattern,
        offset_deg=antenna.offset_deg,
        heading_sigma_deg=antenna.heading_sigma_deg,
        height_sigma_m=antenna.height_sigma_m,
        elevation=open_elevation(Path(antenna.dem)) if antenna.dem else None,
    )
    content = EXPORTS[name].content(survey)
    return content if isinstance(content, bytes) else content.encode()
