"""Remedies in the words of a batch: what options say elsewhere, a manifest says here."""

import re

COLUMN_OF = {
    "format": "format",
    "sample-rate": "sample_rate_hz",
    "center-frequency": "center_frequency_hz",
    "start-time": "start_time",
    "clock-offset": "clock_offset_s",
}
"""Of the manifest, by the option of the commands that read one recording."""
_OPTION = f"--({'|'.join(COLUMN_OF)})\\b"
_OPTIONS = re.compile(f"{_OPTION}(?:, {_OPTION})*(?: and {_OPTION})?")


def by_manifest(text: str) -> str:
    """Name the manifest's columns in place of the options that a batch does not have.

    >>> by_manifest("Give --format, --sample-rate and --center-frequency")
    'Give format, sample_rate_hz and center_frequency_hz in --manifest'
    """
    told = False

    def columns(found: re.Match[str]) -> str:
        nonlocal told
        names = re.sub(_OPTION, lambda one: COLUMN_OF[one[1]], found[0])
        where, told = "" if told else " in --manifest", True
        return f"{names}{where}"

    return _OPTIONS.sub(columns, text)
