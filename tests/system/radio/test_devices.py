"""Two radios on one computer, as the doctor reports them."""

from tests.unit.radio.test_devices import HACKRF, Plug, plug_fixture  # noqa: F401  # fixture

from uavrt.config.settings import RadioSettings, Settings
from uavrt.drone.computer.computer_checks import check_radio


def test_doctor_says_it(plug: Plug) -> None:
    settings = RadioSettings(kind="hackrf")
    plug(HACKRF, "a1")
    plug(HACKRF, "b2")
    finding = check_radio(Settings(radio=settings), None)
    assert not finding.ok
    assert finding.text == "2 HackRF radios are plugged in, and none is selected"
    assert finding.remedy == 'Set [radio] serial to "a1" or "b2"'
