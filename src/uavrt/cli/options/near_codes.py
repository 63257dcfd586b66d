"""Warn about codes in a tag list that are easily confused."""

from collections.abc import Sequence

from uavrt.cli.shown.notices import notice
from uavrt.core.messages import Tag


def warn_of_near_codes(tags: Sequence[Tag], window_hz: float | None = None) -> None:
    """Warn of similar codes of tags whose search bands overlap.

    `window_hz`: half-width of the search bands; None: the usual window.
    """
    if not any(tag.coded for tag in tags):
        return
    from uavrt.config.settings import DetectionSettings
    from uavrt.config.tags.code_rules import words_of_near_codes

    usual_hz = DetectionSettings().frequency_window_hz
    for words in words_of_near_codes(tags, usual_hz if window_hz is None else window_hz):
        notice(f"warning: {words}")
