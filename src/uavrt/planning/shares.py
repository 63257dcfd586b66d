"""Assign tags to drones that search together, once the tags are roughly located."""

from collections.abc import Collection, Mapping

import numpy as np

from uavrt.planning.beliefs import Beliefs, TagBelief
from uavrt.planning.division import Start, divided
from uavrt.planning.tuning import PLANNING


def tags_by_drone(
    beliefs: Beliefs,
    found: Collection[int],
    starts: Mapping[int, Start],
    owners: Mapping[int, int],
    *,
    speed_m_s: float,
) -> dict[int, list[int]]:
    """Assign the located tags that are not yet found to drones; return each drone's tags in the
    order of visits.
    """
    known = [one for tag_id, one in beliefs.items() if tag_id not in found and _is_known(one)]
    drones = list(starts)
    if not known:
        return {drone: [] for drone in drones}
    place: dict[int | None, int] = {drone: at for at, drone in enumerate(drones)}
    places = [one.spread() for one in known]
    rounds = divided(
        [starts[drone] for drone in drones],
        np.array([one.east_m for one in places]),
        np.array([one.north_m for one in places]),
        speed_m_s=speed_m_s,
        stay_s=PLANNING.stay_s,
        owners=[place.get(owners.get(one.tag_id)) for one in known],
    )
    return {
        drone: [known[tag].tag_id for tag in tags]
        for drone, tags in zip(drones, rounds, strict=True)
    }


def _is_known(belief: TagBelief) -> bool:
    """True if a tag's position is known well enough for one drone to search for it alone."""
    area = belief.prior.area
    width = np.hypot(area.east_m - area.west_m, area.north_m - area.south_m) / np.sqrt(12.0)
    return belief.spread().rms_m < float(PLANNING.located_share * width)
