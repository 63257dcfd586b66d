"""Table of the supported radios, one row each.

Gain ranges, values of ``[radio] kind``, programs, names in logs and the service's permissions
for devices are derived from this table. A new radio needs a row here, and either the arguments
of its program (`uavrt.radio.receivers.radio_programs`) or a driver (`uavrt.radio.opening`).

Checked against the programs of Debian 12: airspy 1.0.10, airspyhf 1.6.8, rtl-sdr 0.6.0, hackrf
2022.09.1.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioRow:
    """One kind of supported radio: its programs, gains, rates, frequencies and USB ids."""

    kind: str
    title: str
    gains: tuple[int, int]
    """Lowest and highest gain, in the radio's own steps."""
    default_gain: int | None = None
    """Gain used unless the user sets one [steps of the radio]; None: the driver's default."""
    package: str
    """Debian package with the radio's programs."""
    receive: str = ""
    """Program that writes samples to stdout; empty if a driver is used."""
    inform: tuple[str, ...] = ()
    """Command that prints the sample rates supported by the connected device."""
    sample_format: str = "cf32"
    """Format of the program's samples (`uavrt.radio.formats`)."""
    rates_hz: tuple[tuple[float, float], ...] = ((3e3, 100e6),)
    """Supported sample rates: lowest and highest of each range [Hz]."""
    rates_note: str = ""
    receives_mhz: tuple[tuple[float, float], ...] = ((20.0, 1000.0),)
    """Receivable radio frequencies: lowest and highest of each range [MHz]."""
    tunes_in_float32: bool = False
    """True if the program reads the frequency in megahertz as a float32; the radio then tunes
    in steps of 16 Hz."""
    usual_rate_hz: float = 3e6
    """Sample rate suggested by the first set-up [Hz]."""
    overruns_option: str = ""
    """Option of the radio's program, in recent versions, that makes it print overruns on
    stderr."""
    lists: tuple[str, ...] = ()
    """Command that lists the connected devices with index and serial number. It is needed if
    the receiving program would interpret a numeric serial number as an index."""
    serial_prefix: str = ""
    """Prefix that the program expects before the hexadecimal serial number that USB reports."""
    usb: tuple[tuple[str, str, str], ...] = ()
    """USB vendor id, product id and name of each model."""

    def takes_rate(self, rate_hz: float) -> bool:
        """True if the radio supports a sample rate."""
        return any(low <= rate_hz <= high for low, high in self.rates_hz)

    def rates_text(self, unit_hz: float = 1.0) -> str:
        """Text that lists the supported sample rates, in a given unit."""
        note = f" ({self.rates_note})" if self.rates_note else ""
        return _spans([(a / unit_hz, b / unit_hz) for a, b in self.rates_hz]) + note

    def receives(self, frequency_hz: float) -> bool:
        """True if the radio can be tuned to a frequency."""
        return any(low <= frequency_hz * 1e-6 <= high for low, high in self.receives_mhz)

    def receives_text(self) -> str:
        """Text that lists the supported radio frequencies."""
        return f"{_spans(self.receives_mhz)} MHz"

    def tuned_hz(self, frequency_hz: float, correction_ppm: float = 0.0) -> float:
        """Actual frequency of the radio when its program is set to a frequency [Hz]."""
        if not self.tunes_in_float32:
            return frequency_hz
        factor = 1.0 + correction_ppm * 1e-6
        asked_mhz = _float32(round(frequency_hz / factor * 1e-6, 6))
        return int(_float32(asked_mhz * 1e6)) * factor


def _float32(value: float) -> float:
    return float(struct.unpack("f", struct.pack("f", value))[0])


def _spans(spans: Sequence[tuple[float, float]]) -> str:
    return " or ".join(f"{a:.9g}" if a == b else f"{a:.9g} to {b:.9g}" for a, b in spans)


def _single(*rates_hz: float) -> tuple[tuple[float, float], ...]:
    return tuple((one, one) for one in rates_hz)


RADIOS: dict[str, RadioRow] = {
    row.kind: row
    for row in (
        RadioRow(
            kind="airspy",
            title="Airspy",
            package="airspy",
            receive="airspy_rx",
            inform=("airspy_info",),
            gains=(0, 21),  # "sensitivity" gain
            default_gain=21,
            # airspy_rx reads a number that is not a rate as an index in its list of rates.
            rates_hz=_single(2.5e6, 3e6, 6e6, 10e6),
            rates_note="Mini: 3 and 6 MS/s, R2: 2.5 and 10",
            receives_mhz=((24.0, 1900.0),),
            serial_prefix="0x",
            usb=(("1d50", "60a1", "Airspy Mini and R2"),),
        ),
        RadioRow(
            kind="airspyhf",
            title="Airspy HF+",
            package="airspyhf",
            receive="airspyhf_rx",
            inform=("airspyhf_info",),
            gains=(0, 8),  # steps of 6 dB, 8 is no attenuation
            default_gain=8,
            rates_hz=_single(192e3, 256e3, 384e3, 456e3, 768e3, 912e3),
            receives_mhz=((0.009, 31.0), (60.0, 260.0)),
            tunes_in_float32=True,
            usual_rate_hz=768e3,
            serial_prefix="0x",
            usb=(("03eb", "800c", "Airspy HF+"),),
        ),
        RadioRow(
            kind="rtlsdr",
            title="RTL-SDR",
            package="rtl-sdr",
            receive="rtl_sdr",
            sample_format="cu8",
            # Decibel; 0 would be its automatic gain, which follows the pulses themselves.
            gains=(1, 50),
            default_gain=40,
            # At any other rate rtl_sdr reports an error and continues at the rate set before.
            rates_hz=((225_001, 300e3), (900_001, 3.2e6)),
            receives_mhz=((24.0, 1766.0),),
            usual_rate_hz=250e3,
            # airspy_rx lists all devices and exits, because no device has this serial number.
            lists=("rtl_sdr", "-d", "none", "/dev/null"),
            usb=(("0bda", "2838", "RTL-SDR"), ("0bda", "2832", "RTL-SDR")),
        ),
        RadioRow(
            kind="hackrf",
            title="HackRF",
            package="hackrf",
            receive="hackrf_transfer",
            sample_format="ci8",
            gains=(0, 102),  # LNA and VGA together
            default_gain=64,
            rates_hz=((2e6, 20e6),),
            receives_mhz=((1.0, 6000.0),),
            overruns_option="-B",
            usb=(("1d50", "6089", "HackRF One"),),
        ),
        RadioRow(kind="soapy", title="SoapySDR", package="python3-soapysdr", gains=(0, 120)),
    )
}
"""Properties of all supported radios, by the name in ``[radio] kind``."""
