"""Decisions of a search, in words for a person; its log has every figure."""

import re

from uavrt.messages import SearchNote

_WHY = (
    (r"keeps the distance: waiting", "every way leads too near an animal"),
    (r"listening first", "an animal may be near: it listens before it flies"),
    (r"an animal may be near on every way", "animals may be all around: the safest way"),
    (r"way home takes|way home from there", "the battery is needed for the way home"),
    (r"the time is over", "the time is over"),
    (r"every tag is found", "all animals are found"),
    (r"another drone", "another drone is in the way"),
    (r"(?:away from the animals|a way round it)$", "round the animals"),
    (r"no way is allowed", "no way is allowed"),
    (r"nats about tag (\d+)", r"to learn more about tag \1"),
    (r"survey lines|the next grid point|at a grid point", "along its plan"),
)
_DOES = ((r"^hold for", "wait"), (r"^turn by 360°.*", "turn once in place"))


def in_plain_words(note: SearchNote) -> str:
    """Line for a note: time, action and reason."""
    minutes, seconds = divmod(round(note.elapsed_s), 60)
    return f"{minutes:2d}:{seconds:02d} {_words(note)}"


def with_figures(note: SearchNote) -> str:
    """Line for a note, as in the search's own log."""
    minutes, seconds = divmod(round(note.elapsed_s), 60)
    return f"{minutes:2d}:{seconds:02d} {note.text}: {note.reason}"


def _words(note: SearchNote) -> str:
    match note.event:
        case "begun":
            return note.text
        case "found":
            within = [one.radius95_m for one in note.tags if one.tag_id == note.tag_id]
            return note.text + "".join(f", within {metres:.0f} m (95 %)" for metres in within)
        case "ended":
            return f"the search has ended: {note.text}"
        case "decision":
            why = _why(note.reason)
            return _does(note.text) + (f": {why}" if why else "")


def _does(text: str) -> str:
    for pattern, words in _DOES:
        text = re.sub(pattern, words, text)
    return text


def _why(reason: str) -> str:
    """The reason without its figures; empty if only figures remain."""
    for pattern, words in _WHY:
        if (found := re.search(pattern, reason)) is not None:
            return found.expand(words)
    return ""
