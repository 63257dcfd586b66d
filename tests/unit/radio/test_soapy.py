"""SoapySDR is not on PyPI: a module with its calls, found on the path, stands in for it."""

import sys
from pathlib import Path

import numpy as np
import pytest
from some import some

from uavrt.config.settings import RadioSettings
from uavrt.core.errors import RadioMissing, RadioStopped
from uavrt.radio.opening import open_radio
from uavrt.radio.receivers.soapy import SoapySource

MODULE = """
import os
calls = []

class Result:
    def __init__(self, ret, time_ns=None):
        self.ret = ret
        self.flags = 0 if time_ns is None else 4
        self.timeNs = time_ns or 0

class Device:
    def __init__(self, arguments):
        calls.append(("open", arguments))
        if "absent" in arguments:
            raise RuntimeError("no match")
        self.next = 0
        self.answers = []
        self.missing = 0
        self.lose_at = None

    def __getattr__(self, name):
        answers = {"getSampleRate": 250e3, "getFrequency": 148.7e6, "getSettingInfo": []}
        answer = answers.get(name, "stream")
        return lambda *arguments: calls.append((name, *arguments)) or answer

    def readStream(self, stream, buffers, count, timeoutUs):
        if self.answers:
            return Result(self.answers.pop(0))
        count = min(count, 1000)
        if self.lose_at is not None:
            if self.next == self.lose_at:
                self.missing = 777
            time_ns = 4000 * (self.next + self.missing)
            self.next += count
            return Result(count, time_ns)
        for i in range(count):
            buffers[0][i] = self.next + i
        self.next += count
        return Result(count)
"""


@pytest.fixture
def soapy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "SoapySDR.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "SoapySDR", raising=False)


SETTINGS = RadioSettings(kind="soapy", sample_rate_hz=250e3, gain=30, serial="driver=lime")


@pytest.mark.usefixtures("soapy")
def test_a_soapy_radio_is_set_up_read_and_given_back() -> None:
    source = open_radio(SETTINGS, 148.7e6)
    blocks = [some(source.read()) for _ in range(2)]
    count = len(blocks[0].samples)
    # Blocks share their memory: what is seen now is the second.
    np.testing.assert_array_equal(blocks[1].samples.real, np.arange(count, 2 * count))
    assert blocks[1].sample_index == count
    source.close()
    source.close()
    calls = sys.modules["SoapySDR"].calls
    assert calls[0] == ("open", "driver=lime")
    assert ("setSampleRate", 1, 0, 250e3) in calls
    assert ("setFrequency", 1, 0, 148.7e6) in calls
    assert ("setGain", 1, 0, 30.0) in calls
    assert ("setGainMode", 1, 0, False) in calls
    assert [call[0] for call in calls].count("closeStream") == 1


@pytest.mark.usefixtures("soapy")
def test_overflows_and_timeouts_are_lived_with_and_errors_end_the_stream() -> None:
    source = SoapySource(SETTINGS, 148.7e6)
    source._device.answers = [-4, -1, 500]
    assert source.read() is not None
    assert source.overflows == 1
    source._device.answers = [-3]
    with pytest.raises(RadioStopped, match="-3"):
        source.read()
    source.close()


@pytest.mark.usefixtures("soapy")
def test_the_radios_own_times_give_a_gap_exactly_and_in_its_place() -> None:
    source = SoapySource(SETTINGS, 148.7e6)
    source._device.lose_at = 3000
    first, second = some(source.read()), some(source.read())
    assert (first.sample_index, len(first.samples), first.lost_before) == (0, 3000, 0)
    assert (second.sample_index, second.lost_before, source.samples_lost) == (3777, 777, 777)
    source.close()


@pytest.mark.usefixtures("soapy")
def test_a_soapy_device_that_is_not_there_is_missing() -> None:
    with pytest.raises(RadioMissing, match="no radio is found"):
        open_radio(RadioSettings(kind="soapy", serial="absent=1"), 148e6)


def test_without_the_module_the_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "SoapySDR", None)
    with pytest.raises(RadioMissing, match="python3-soapysdr"):
        open_radio(SETTINGS, 148e6)
