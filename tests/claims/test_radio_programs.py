"""The radios' own programs at all their rates, with the page.

At least 60 combinations of radio, rate and fault; none may deliver nothing without a word.
"""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from radio_faults import STEPS, check, expected, fly
from radio_world import missing, usable

RADIOS_AND_RATES_HZ = {
    "airspy": (2.5e6, 3e6, 6e6),
    "airspyhf": (192e3, 256e3, 384e3, 768e3, 912e3),
    "rtlsdr": (250e3, 1.024e6, 2.4e6),
    "hackrf": (2e6, 4e6),
    "soapy": (250e3, 1e6),
}
COMBINATIONS = 60


@pytest.mark.timeout(3600)
def test_every_radio_rate_and_fault_shows_one_right_sentence(tmp_path: Path) -> None:
    cases = [
        (kind, rate_hz)
        for kind, rates_hz in RADIOS_AND_RATES_HZ.items()
        if usable(kind)
        for rate_hz in rates_hz
    ]
    if not cases:
        pytest.skip(missing("airspy") or "")
    places = [tmp_path / f"{kind}_{rate_hz:.0f}" for kind, rate_hz in cases]
    for place in places:
        place.mkdir()
    with ThreadPoolExecutor(2) as pool:
        flown = list(
            pool.map(lambda place, case: fly(place, *case, with_page=True), places, cases)
        )
    seen = wrong = 0
    for (kind, rate_hz), one in zip(cases, flown, strict=True):
        for number, fault in enumerate(STEPS):
            try:
                assert (fault, number) in one.seen, one.error
                check(one.seen[fault, number], kind, fault, rate_hz)
                seen += 1
            except AssertionError as error:
                wrong += 1
                print(kind, rate_hz, fault, str(error)[:300])
        wrong += expected(kind, STEPS[-1], rate_hz) not in one.late_page
    print(f"{seen} combinations of radio, rate and fault are right, {wrong} are wrong")
    assert wrong == 0
    if len(cases) == sum(map(len, RADIOS_AND_RATES_HZ.values())):
        assert seen >= COMBINATIONS
