"""Remedies for a batch, with manifest columns instead of command-line options."""

COLUMN_OF = {
    "--format": "format",
    "--sample-rate": "sample_rate_hz",
    "--center-frequency": "center_frequency_hz",
    "--start-time": "start_time",
    "--clock-offset": "clock_offset_s",
}
"""Manifest columns by the option of the commands that read one recording."""


def by_manifest(text: str) -> str:
    """Name the manifest's columns in place of the options that a batch does not have."""
    named = text
    for option, column in COLUMN_OF.items():
        named = named.replace(option, column)
    return text if named == text else f"{named} (in --manifest)"
