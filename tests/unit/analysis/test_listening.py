"""What samples and poses do not hold of each other is told, and only that."""

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.analysis.inputs.listening_times import limits_of, listened_in, within
from uavrt.core.clock import iso_intervals, parse_iso_intervals
from uavrt.localization.estimates.heard import PoseColumns
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies

START_NS = 1_700_000_000_000_000_000
SECOND = 1_000_000_000


def energies(heard_s: NDArray[np.bool_]) -> SlotEnergies:
    """A hundred slots a second, all of them alike."""
    heard = np.repeat(heard_s, 100)
    none = np.zeros((1, len(heard)), np.float32)
    return SlotEnergies(
        energy=none,
        heard=heard,
        offsets_hz=np.zeros(1),
        start_ns=START_NS,
        slot_s=0.01,
        mean=np.ones(1),
        sigma=np.ones(1),
        left_out=0,
        level=none,
        loud=none > 0.0,
        listened=heard,
        noise_db=np.zeros(len(heard)),
    )


def poses(first_s: float, last_s: float) -> PoseColumns:
    time_ns = START_NS + np.arange(first_s * 5, last_s * 5 + 1).astype(np.int64) * SECOND // 5
    nothing = np.zeros(len(time_ns))
    return PoseColumns(
        time_ns=time_ns,
        latitude_deg=nothing,
        longitude_deg=nothing,
        height_m=nothing,
        quaternion_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (len(time_ns), 1)),
    )


def test_whole_seconds_with_samples_are_laid_together() -> None:
    heard = np.ones(60, bool)
    heard[20:30] = False
    found = listened_in(energies(heard))
    assert [(a - START_NS, b - START_NS) for a, b in found] == [
        (0, 20 * SECOND),
        (30 * SECOND, 60 * SECOND),
    ]
    at = START_NS + np.array([19.5, 20.5, 30.5, 60.5]) * SECOND
    assert within(at, found).tolist() == [True, False, True, False]
    assert parse_iso_intervals(iso_intervals(found)) == found
    assert listened_in(energies(np.zeros(5, bool))) == ()


@pytest.mark.parametrize(
    ("flown", "says"),
    [
        ((0.0, 60.0), []),
        ((0.0, 120.0), ["50% of the flight"]),
        ((0.0, 30.0), ["% of the samples have no pose"]),
        ((40.0, 160.0), ["17% of the flight", "% of the samples have no pose"]),
    ],
)
def test_time_without_samples_or_without_poses_is_told(
    flown: tuple[float, float], says: list[str]
) -> None:
    told = limits_of(energies(np.ones(60, bool)), poses(*flown))
    assert len(told) == len(says)
    assert all(part in text for part, text in zip(says, told, strict=True))
