"""Compute and compare digests of the tag lists of drone and ground station.

A drone that detects refuses new tags and reports a digest of its tag list. By this digest, a
restarted ground station recognises its own list and continues to receive.
"""

import hashlib
import re
from collections.abc import Iterable

from uavrt.core.messages import Tag
from uavrt.link.tunnel.tunnel_records import tag_to_wire

MOST_NAMED = 10
_DIGEST = re.compile(r"\blist ([0-9a-f]{8})\b")


def tag_list_digest(tags: Iterable[Tag]) -> str:
    """Return eight hexadecimal digits that identify a tag list despite order and names."""
    encoded = sorted(_of_code(tag) if tag.coded else tag_to_wire(tag).encode() for tag in tags)
    return hashlib.blake2b(b"".join(encoded), digest_size=4).hexdigest()


def _of_code(tag: Tag) -> bytes:
    """Return bytes that identify a coded tag; times are in microseconds."""
    times_s = (*tag.gaps_s, *tag.pulse_intervals_s, tag.pulse_width_s)
    numbers = (tag.tag_id, round(tag.frequency_hz), *(round(1e6 * one) for one in times_s))
    return b"coded" + repr(numbers).encode()


def searched_text(tags: Iterable[Tag]) -> str:
    """Text on the searched tags, at most 64 characters: ``tags 2, 4 (list 0a1b2c3d)``."""
    known = list(tags)
    digest = tag_list_digest(known)
    ids = ", ".join(str(tag.tag_id) for tag in known)
    if len(known) > MOST_NAMED or len(ids) > 40:
        ids = f"{known[0].tag_id} and {len(known) - 1} more"
    return f"tags {ids} (list {digest})"


def digest_in(text: str) -> str | None:
    """Find a tag list's digest in a drone's text; None if the text has none."""
    found = _DIGEST.search(text)
    return found[1] if found else None
