"""The radios' own programs and SoapySDR over stand-in libraries, through `uavrt run`.

Each fault must show the same right sentence in log, monitor, page and doctor. More sample
rates: `tests/claims/test_radio_programs.py`.
"""

from concurrent.futures import ThreadPoolExecutor

import pytest
from radio_faults import STEPS, Flown, check, expected, fly
from radio_world import SERIALS, missing, needs

RATES_HZ = {"airspy": 3e6, "airspyhf": 192e3, "rtlsdr": 250e3, "hackrf": 2e6, "soapy": 250e3}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Flown]:
    """Fly with all radios at the same time: it is mostly waiting."""
    kinds = [kind for kind in SERIALS if missing(kind) is None]
    places = [tmp_path_factory.mktemp(kind) for kind in kinds]
    with ThreadPoolExecutor(len(SERIALS)) as pool:
        return dict(
            zip(kinds, pool.map(fly, places, kinds, map(RATES_HZ.get, kinds)), strict=True)
        )


@pytest.mark.parametrize("number", range(len(STEPS)), ids=[*STEPS])
@pytest.mark.parametrize("kind", SERIALS)
def test_a_fault_shows_the_same_sentence_wherever_one_looks(
    flown: dict[str, Flown], kind: str, number: int
) -> None:
    needs(kind)
    one = flown[kind]
    fault = STEPS[number]
    assert (fault, number) in one.seen, one.error
    seen = one.seen[fault, number]
    check(seen, kind, fault, RATES_HZ[kind])


@pytest.mark.parametrize("kind", SERIALS)
def test_a_ground_station_that_comes_after_a_fault_reads_its_reason(
    flown: dict[str, Flown], kind: str
) -> None:
    needs(kind)
    words = expected(kind, STEPS[-1], RATES_HZ[kind])
    assert words in flown[kind].late_page
