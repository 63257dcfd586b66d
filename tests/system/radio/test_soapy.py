"""A SoapySDR radio that stalls, in real time."""

import pytest
from tests.unit.radio.test_soapy import SETTINGS, soapy  # noqa: F401  # fixture

from uavrt.core.errors import RadioStalled
from uavrt.radio.receivers.soapy import SoapySource


@pytest.mark.usefixtures("soapy")
def test_a_soapy_radio_that_gives_nothing_is_stalled_or_simply_not_ready() -> None:
    source = SoapySource(SETTINGS, 148.7e6, stall_s=0.05)
    source._device.answers = [-1] * 1_000_000
    assert source.read(timeout_s=0.0) is None
    with pytest.raises(RadioStalled):
        source.read()
    source.close()
