"""Replace command-line options in a batch's error messages by columns of the manifest."""

COLUMN_OF = {
    "--format": "format",
    "--sample-rate": "sample_rate_hz",
    "--center-frequency": "center_frequency_hz",
    "--start-time": "start_time",
    "--clock-offset": "clock_offset_s",
    "--vehicle": "vehicle",
}
"""Column of the manifest for each option of the commands that read one recording."""


def by_manifest(text: str) -> str:
    """Replace command-line options in an error message by the manifest's columns."""
    named = text
    for option, column in COLUMN_OF.items():
        named = named.replace(option, column)
    return text if named == text else f"{named} (in --manifest)"
