"""A flight as files for other programs, by the writers of ``uavrt export``."""

from collections.abc import Callable
from pathlib import Path

from uavrt.analysis.export.geojson import geojson_text
from uavrt.analysis.export.gpx import gpx_text
from uavrt.analysis.export.kmz import kml_text, kmz_bytes
from uavrt.analysis.export.tables import pulses_csv
from uavrt.analysis.survey import Survey, read_survey
from uavrt.ground.estimates import AntennaChoice

EXPORTS = {
    "csv": "text/csv",
    "geojson": "application/geo+json",
    "kml": "application/vnd.google-earth.kml+xml",
    "kmz": "application/vnd.google-earth.kmz",
    "gpx": "application/gpx+xml",
}
"""Formats and their media types."""

_WRITERS: dict[str, Callable[[Survey], str | bytes]] = {
    "csv": pulses_csv,
    "geojson": geojson_text,
    "kml": kml_text,
    "kmz": kmz_bytes,
    "gpx": gpx_text,
}


def export(name: str, flight: Path, antenna: AntennaChoice) -> bytes:
    """Write a flight, with its marks, in one of `EXPORTS`."""
    survey = read_survey(flight, antenna=antenna.pattern, offset_deg=antenna.offset_deg)
    content = _WRITERS[name](survey)
    return content if isinstance(content, bytes) else content.encode()
