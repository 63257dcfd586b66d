"""What derives from the table of radios."""

import re
from pathlib import Path

import pytest

from uavrt.config.loader import load_settings
from uavrt.config.parameters import with_parameter
from uavrt.config.radios import RADIOS, RadioRow
from uavrt.core.errors import ConfigError
from uavrt.drone.computer.service import rule_text
from uavrt.flight.flight_layout import FlightLayout
from uavrt.radio.formats import sample_format
from uavrt.radio.receivers.radio_programs import ARGUMENTS

ROOT = Path(__file__).parents[3]
EACH = pytest.mark.parametrize("radio", RADIOS.values(), ids=lambda row: row.kind)


@EACH
def test_a_program_has_arguments_and_samples_of_a_known_format(radio: RadioRow) -> None:
    assert (radio.kind in ARGUMENTS) == bool(radio.receive)
    assert sample_format(radio.sample_format)


@EACH
def test_the_settings_take_it_and_a_ground_station_sets_its_gains(
    radio: RadioRow, tmp_path: Path
) -> None:
    path = tmp_path / "uavrt.toml"
    path.write_text(f'[radio]\nkind = "{radio.kind}"\n')
    settings = load_settings(path)
    for gain in radio.gains:
        assert with_parameter(settings, "RADIO_GAIN", gain).radio.gain == gain
    with pytest.raises(ConfigError, match=f"{radio.gains[0]} to {radio.gains[1]}"):
        with_parameter(settings, "RADIO_GAIN", radio.gains[1] + 1)


@EACH
def test_the_manual_shows_its_program_its_package_and_its_gains(radio: RadioRow) -> None:
    page = (ROOT / "docs/reference/radios.md").read_text(encoding="utf-8")
    line = next(line for line in page.splitlines() if line.startswith(f"| `{radio.kind}`"))
    assert radio.package in line
    if radio.receive:
        assert f"`{radio.receive}`" in line
        assert f"{radio.gains[0]}–{radio.gains[1]}" in line
        assert re.search(rf"; {radio.default_gain} \|", line)


def test_the_words_of_each_program_lie_with_those_of_the_radio() -> None:
    layout = FlightLayout(Path("flight"))
    logs = [layout.process_log(radio.receive) for radio in RADIOS.values() if radio.receive]
    assert {log.parent.name for log in logs} == {"airspy_csdr_netcat_log"}


@EACH
def test_the_service_may_open_it(radio: RadioRow) -> None:
    for vendor, product, name in radio.usb:
        assert vendor in rule_text()
        assert product in rule_text()
        assert name in rule_text()
