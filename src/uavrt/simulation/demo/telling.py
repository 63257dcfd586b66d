"""Write lines on the progress of a search for the terminal."""

import re

from uavrt.core.messages import SearchNote

_DOES = ((r"^hold for", "wait"), (r"^turn by 360°.*", "turn once in place"))


def in_plain_words(note: SearchNote) -> str:
    """Text line for an entry in the log of a search: time and event."""
    minutes, seconds = divmod(round(note.elapsed_s), 60)
    return f"{minutes:2d}:{seconds:02d} {_words(note)}"


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
            return f"{_does(note.text)}: {note.reason}"


def _does(text: str) -> str:
    for pattern, words in _DOES:
        text = re.sub(pattern, words, text)
    return text
