"""Group tags whose search bands overlap. The search for one tag of a group also receives the
pulses of the others.
"""

from collections.abc import Sequence

from uavrt.core.messages import Tag


def overlapping(bands_hz: Sequence[tuple[float, float]]) -> list[list[int]]:
    """Group frequency bands (lower and upper edge) that overlap directly or through other
    bands; return the bands' indices.
    """
    found: list[list[int]] = []
    reach_hz = 0.0
    for place in sorted(range(len(bands_hz)), key=lambda at: bands_hz[at]):
        low_hz, high_hz = bands_hz[place]
        if found and low_hz < reach_hz:
            found[-1].append(place)
            reach_hz = max(reach_hz, high_hz)
        else:
            found.append([place])
            reach_hz = high_hz
    return sorted(sorted(places) for places in found)


def tags_by_band(tags: Sequence[Tag], window_hz: float) -> list[list[Tag]]:
    """Group tags whose search bands overlap, given the search's half-width."""
    bands_hz = [(tag.frequency_hz - window_hz, tag.frequency_hz + window_hz) for tag in tags]
    return [[tags[place] for place in places] for places in overlapping(bands_hz)]
