"""The radios' own programs and SoapySDR over stand-in libraries, through `uavrt run`.

Each fault must show the same right sentence in log, monitor, page and doctor. More sample
rates: `tests/claims/test_radio_programs.py`.
"""

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median

import pytest
from radio_faults import NO_USB, STEPS, Flown, check, doctor, expected, fly
from radio_world import SERIALS, TAG_HZ, RadioWorld, default_radio, missing, needs

from uavrt.config.loader import load_settings
from uavrt.config.radios import RADIOS
from uavrt.core.errors import ConfigError

# Together the radios stream 6 MS/s.
pytestmark = [pytest.mark.full_rate, pytest.mark.timeout(300)]
RATES_HZ = {"airspy": 3e6, "airspyhf": 192e3, "rtlsdr": 250e3, "hackrf": 2e6, "soapy": 250e3}
GAINS = {"soapy": 20}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Flown]:
    """Fly with all radios at the same time: it is mostly waiting."""
    kinds = [kind for kind in SERIALS if missing(kind) is None]
    places = [tmp_path_factory.mktemp(kind) for kind in kinds]

    def one(place: Path, kind: str) -> Flown:
        # The first has the time: a late station waits while the others go on.
        return fly(place, kind, RATES_HZ[kind], late=kind == kinds[0])

    with ThreadPoolExecutor(len(SERIALS)) as pool:
        return dict(zip(kinds, pool.map(one, places, kinds), strict=True))


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


def test_a_ground_station_that_comes_after_a_fault_reads_its_reason(
    flown: dict[str, Flown],
) -> None:
    """The radios differ in nothing here; `make claims` has all."""
    kind = next((kind for kind in SERIALS if missing(kind) is None), "airspy")
    needs(kind)
    words = expected(kind, STEPS[-1], RATES_HZ[kind])
    assert words in flown[kind].late_page


DOCTOR_FAULTS = (*(one for one in STEPS if one not in ("works", "unplugged")), "works")
Examined = dict[str, tuple[dict[str, list[str]], list[str]]]


def examine(directory: Path, kind: str) -> tuple[dict[str, list[str]], list[str]]:
    """Get the lines of doctor for each fault, and the calls of the radio's library."""
    radio = default_radio(
        kind, serial=SERIALS[kind], bias_tee=kind != "airspyhf", gain=GAINS.get(kind)
    )
    serials = ("77770001", SERIALS[kind]) if kind == "rtlsdr" else ()
    lines = doctor(directory, radio, DOCTOR_FAULTS, serials=serials)
    return lines, RadioWorld.calls_in(directory)


@pytest.fixture(scope="module")
def examined(tmp_path_factory: pytest.TempPathFactory) -> Examined:
    """Examine all radios at the same time, of two RTL-SDR dongles the second."""
    kinds = [kind for kind in SERIALS if missing(kind) is None]
    places = [tmp_path_factory.mktemp(f"doctor_{kind}") for kind in kinds]
    with ThreadPoolExecutor(len(SERIALS)) as pool:
        return dict(zip(kinds, pool.map(examine, places, kinds), strict=True))


@pytest.mark.parametrize("fault", DOCTOR_FAULTS)
@pytest.mark.parametrize("kind", SERIALS)
def test_doctor_says_the_same_while_no_flight_is_on(
    examined: Examined, kind: str, fault: str
) -> None:
    needs(kind)
    radio, *others, status = examined[kind][0][fault]
    rate_hz = default_radio(kind).sample_rate_hz
    works = f"ok radio        {RADIOS[kind].title}: {rate_hz:.0f} samples a second arrive"
    if fault == "works":
        assert radio == works
    elif fault == "loses":  # in time for doctor a share, or a rate
        assert re.match(r"!! radio .* (\d+ % of the samples are lost\.|arrive, not) .*", radio)
    else:
        assert radio.startswith("!! radio")
        assert expected(kind, fault, rate_hz) in radio
    may_open = kind in NO_USB or fault != "forbidden"
    assert others[0].startswith("ok permissions" if may_open else "!! permissions  /dev/bus")
    assert status == str(int(any(one.startswith("!!") for one in (radio, *others))))


@pytest.mark.parametrize(
    ("kind", "rates"), [("airspy", "2500000 10000000"), ("soapy", "2500000 10000000")]
)
def test_the_rates_of_the_radio_that_is_there_are_named(
    tmp_path: Path, kind: str, rates: str
) -> None:
    """Such as an Airspy R2, at the default rate of a Mini."""
    needs(kind)
    RadioWorld(tmp_path, kind).write("rates", rates)
    lines = doctor(tmp_path, default_radio(kind, sample_rate_hz=3e6), ("works",), rates=rates)
    assert lines["works"][0] == (
        f"!! radio        {RADIOS[kind].title}: 3000000 samples a second are not supported. "
        "Set [radio] sample_rate_hz to 2500000 or 10000000"
    )


def test_a_serial_number_chooses_the_dongle_and_where_the_bias_voltage_goes(
    examined: Examined,
) -> None:
    needs("rtlsdr")
    lines, calls = examined["rtlsdr"]
    assert lines["works"][0].startswith("ok")
    opened = [call for call in calls if call.startswith("rtlsdr_open")]
    assert opened[-2:] == ["rtlsdr_open 1"] * 2, "rtl_biast and rtl_sdr"
    assert "rtlsdr_open 0" not in opened


@pytest.mark.parametrize(
    ("kind", "calls"),
    [
        ("airspy", ["airspy_open 35AC63DC2D8C7A4F", "airspy_set_rf_bias 1"]),
        ("airspyhf", ["airspyhf_open DD52AAAA12345678", "airspyhf_set_hf_agc 0"]),
        ("rtlsdr", ["rtlsdr_set_bias_tee_gpio 1", "rtlsdr_set_tuner_gain_mode 1"]),
        ("hackrf", ["hackrf_set_antenna_enable 1", "hackrf_set_amp_enable 0"]),
        ("soapy", ["manual gain", "biastee true", "gain 20"]),
    ],
)
def test_each_radio_gets_its_settings_and_no_automatic_gain(
    examined: Examined, kind: str, calls: list[str]
) -> None:
    needs(kind)
    assert set(calls) <= set(examined[kind][1])


def test_settings_refuse_a_rate_that_the_program_would_accept(tmp_path: Path) -> None:
    """rtl_sdr at 500 kS/s prints a warning and streams on at another rate."""
    config = tmp_path / "uavrt.toml"
    for kind, rate_hz in (("rtlsdr", 500e3), ("airspy", 2.4e6), ("airspyhf", 600e3)):
        config.write_text(f'[radio]\nkind = "{kind}"\nsample_rate_hz = {rate_hz}\n')
        with pytest.raises(ConfigError, match=f"sample_rate_hz is {rate_hz:.0f}, but must be"):
            load_settings(config)


@pytest.mark.parametrize("kind", SERIALS)
def test_the_tag_is_found_at_its_frequency(flown: dict[str, Flown], kind: str) -> None:
    """Also with airspyhf_rx, which rounds the frequency that it is given."""
    needs(kind)
    found_hz = flown[kind].pulses_hz
    assert len(found_hz) >= 3, flown[kind].error
    assert median(found_hz) == pytest.approx(TAG_HZ, abs=1.0)
