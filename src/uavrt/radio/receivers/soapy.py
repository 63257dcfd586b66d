"""Read any radio that has a SoapySDR driver, through SoapySDR's Python module.

The module is a system package (Debian ``python3-soapysdr``) or comes from the maker of the
driver, but is not on PyPI. So it is imported only when such a radio is opened.
"""

import importlib
from typing import Any, Final

import numpy as np

from uavrt.config.settings import RadioSettings
from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.errors import RadioError, RadioMissing
from uavrt.core.log import get_logger
from uavrt.core.messages import IQBlock
from uavrt.core.units import ns_from_s
from uavrt.radio.live_source import RADIO_RATE_REMEDY, LiveSource
from uavrt.radio.receivers.program_messages import exit_error, stalled
from uavrt.radio.sample_stream import block_length

_STALL_S: Final = 3.0
_SLICE_S: Final = 0.25
# SoapySDR/Constants.h and Errors.h
_RX: Final = 1
_TIMEOUT: Final = -1
_OVERFLOW: Final = -4
_HAS_TIME: Final = 1 << 2
_ROUNDING_S: Final = 1e-4
"""Maximum difference between a driver's time stamp and the expected time that counts as
rounding and not as a gap [s]."""
_SAME: Final = 1e-4
_SAME_HZ: Final = 1000.0
"""Maximum accepted difference between the requested and the actual radio frequency [Hz]."""

log = get_logger()


class SoapySource(LiveSource):
    """Reads samples through a SoapySDR driver.

    The setting `serial` is a serial number or a device string such as ``driver=lime``.
    """

    RATE_REMEDY = RADIO_RATE_REMEDY

    def __init__(
        self,
        settings: RadioSettings,
        center_frequency_hz: float,
        clock: Clock | None = None,
        *,
        stall_s: float = _STALL_S,
    ) -> None:
        super().__init__(settings.sample_rate_hz, center_frequency_hz)
        try:
            soapy: Any = importlib.import_module("SoapySDR")
        except ImportError as error:
            raise RadioMissing(
                "SoapySDR's Python module is not installed",
                remedy="Install the module: sudo apt install python3-soapysdr, and make "
                "uavrt's environment with --system-site-packages",
            ) from error
        self.overflows = 0
        self._clock = Clock.start() if clock is None else clock
        self._device_ns: int | None = None
        """Expected time of the next sample by the radio's own clock [ns]; None if unknown."""
        self._stall_s = stall_s
        self._samples = np.zeros(block_length(self.sample_rate_hz), np.complex64)
        self._filled = self._given = 0
        self._last_s = monotonic_s()
        self._settings = settings
        self._stream: Any = None
        try:
            self._device = soapy.Device(_device_arguments(settings))
            self._set(center_frequency_hz)
            self._stream = self._device.setupStream(_RX, "CF32")
            self._device.activateStream(self._stream)
        except RuntimeError as error:
            raise self._error(str(error)) from error

    def _set(self, center_frequency_hz: float) -> None:
        """Configure the radio and check the values in effect.

        Drivers may select the nearest supported value in place of the requested one.
        """
        device, settings = self._device, self._settings
        device.setSampleRate(_RX, 0, self.sample_rate_hz)
        if abs(device.getSampleRate(_RX, 0) / self.sample_rate_hz - 1.0) > _SAME:
            raise self._error("sample rate")
        asked_hz = center_frequency_hz / (1.0 + settings.frequency_correction_ppm * 1e-6)
        device.setFrequency(_RX, 0, asked_hz)
        if abs(device.getFrequency(_RX, 0) - asked_hz) > _SAME_HZ:
            raise self._error("frequency")
        if device.hasGainMode(_RX, 0):
            device.setGainMode(_RX, 0, False)  # automatic gain would follow the pulses
        if settings.gain is not None:
            device.setGain(_RX, 0, float(settings.gain))
        # Set in any case: the setting remains from an earlier flight.
        if settings.bias_tee or "biastee" in [one.key for one in device.getSettingInfo()]:
            device.writeSetting("biastee", "true" if settings.bias_tee else "false")

    def _error(self, words: str) -> RadioError:
        return exit_error(self._settings, 0, "failed", words, own_rates=self._own_rates)

    def _own_rates(self) -> str:
        ranges = self._device.getSampleRateRange(_RX, 0)
        return " or ".join(
            f"{one.minimum():.0f}"
            + (f" to {one.maximum():.0f}" if one.maximum() > one.minimum() else "")
            for one in ranges
        )

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Get the next block, or None after `timeout_s`; raises as `SampleSource.read`."""
        deadline_s = None if timeout_s is None else monotonic_s() + timeout_s
        self._samples[: self._filled - self._given] = self._samples[self._given : self._filled]
        self._filled -= self._given
        self._given = 0
        while self._filled < len(self._samples) and not self._placer.cut:
            now_s = monotonic_s()
            if deadline_s is not None and now_s > deadline_s:
                return None
            if now_s - self._last_s > self._stall_s:
                raise stalled("SoapySDR")
            left_s = _SLICE_S if deadline_s is None else min(_SLICE_S, deadline_s - now_s)
            self._read_some(max(left_s, 0.0))
        return self._block()

    def close(self) -> None:
        """Stop the sample stream of the radio."""
        if self._stream is not None:
            self._device.deactivateStream(self._stream)
            self._device.closeStream(self._stream)
            self._stream = None

    def _read_some(self, timeout_s: float) -> None:
        rest = self._samples[self._filled :]
        result = self._device.readStream(
            self._stream, [rest], len(rest), timeoutUs=int(timeout_s * 1e6)
        )
        if result.ret > 0:
            self._find_gap(result)
            self._filled += result.ret
            self._last_s = monotonic_s()
            self._placer.arrived(self._filled, self._clock.now_ns())
        elif result.ret == _OVERFLOW:
            # Drivers do not report the number lost; time stamps or arrival times will show it.
            self.overflows += 1
            self._placer.expect_losses()
            log.seldom(self.overflows, "radio overflow")
        elif result.ret not in (0, _TIMEOUT):
            raise self._error(f"the stream failed with error {result.ret}")

    def _find_gap(self, result: Any) -> None:
        time_ns = int(getattr(result, "timeNs", 0))
        if not int(getattr(result, "flags", 0)) & _HAS_TIME:
            self._device_ns = None
            return
        if self._device_ns is not None:
            ahead = round((time_ns - self._device_ns) * 1e-9 * self.sample_rate_hz)
            if ahead > max(_ROUNDING_S * self.sample_rate_hz, 2):
                self._placer.add_lost(ahead, self._filled)
        self._device_ns = time_ns + ns_from_s(result.ret / self.sample_rate_hz)

    def _block(self) -> IQBlock:
        self._placer.settle()
        first = self._placer.cut
        self._given = first if 0 < first < self._filled else self._filled
        return self._placer.place(self._samples[: self._given])


def _device_arguments(settings: RadioSettings) -> str:
    serial = settings.serial or ""
    return serial if "=" in serial or not serial else f"serial={serial}"
