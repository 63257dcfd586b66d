"""Base of all live sources: rate, frequency, and the numbering of samples."""

import select
from typing import ClassVar

from uavrt.errors import FormatError
from uavrt.radio.placing import Placer
from uavrt.radio.udp_address import listen, parse_udp_address

_MEGAHERTZ = (20.0, 10e3)
"""Frequencies below this are not in hertz, but surely in megahertz."""
RADIO_RATE_REMEDY = (
    "Check the radio's cable and this computer's load, or set [radio] sample_rate_hz to a rate "
    "that the radio takes"
)
"""Remedy for a wrong rate, and for a cable or computer that steadily loses samples."""


def check_rates(sample_rate_hz: float, center_frequency_hz: float) -> None:
    """Raise `FormatError` unless rate and frequency are positive and plausible."""
    if not 0.0 < sample_rate_hz < 1e9:
        raise FormatError(
            f"sample rate {sample_rate_hz} Hz is not possible",
            remedy="Give --sample-rate in samples per second, e.g. 3000000",
        )
    if _MEGAHERTZ[0] <= center_frequency_hz < _MEGAHERTZ[1]:
        raise FormatError(
            f"center frequency {center_frequency_hz:g} Hz is that of sound, and looks like "
            "megahertz",
            remedy=f"Give --center-frequency {center_frequency_hz:g}e6",
        )
    if not 0.0 <= center_frequency_hz < 1e12:
        raise FormatError(
            f"center frequency {center_frequency_hz} Hz is not possible",
            remedy="Give --center-frequency in hertz, e.g. 148.7e6",
        )


class LiveSource:
    """Base of sources without a known length.

    `start_time_ns`: time of the first sample [ns, UTC]; then times follow from the nominal rate
    alone. `start_moves`: date the start again if the first arrivals were held up. Raises
    `FormatError`: an impossible rate.
    """

    MAY_BE_SLOW: ClassVar[bool] = False
    """Whether the writer may be slower than real time; a shortfall is no loss then."""
    RATE_REMEDY: ClassVar[str] = "Set the sample rate to the one that the sender uses"
    """Remedy for samples that arrive at another rate."""

    def __init__(
        self,
        sample_rate_hz: float,
        center_frequency_hz: float,
        start_time_ns: int | None = None,
        *,
        start_moves: bool = True,
    ) -> None:
        check_rates(sample_rate_hz, center_frequency_hz)
        self._rate_hz = sample_rate_hz
        self._center_hz = center_frequency_hz
        self._placer = Placer(
            sample_rate_hz,
            start_time_ns=start_time_ns,
            start_moves=start_moves,
            may_be_slow=self.MAY_BE_SLOW,
            rate_remedy=self.RATE_REMEDY,
        )

    @property
    def samples_lost(self) -> int:
        """Samples that never came, by the radio's report or by the arrivals."""
        return self._placer.lost

    @property
    def lost_withdrawn(self) -> int:
        """Samples counted as lost in blocks before the source turned out to be slow."""
        return self._placer.withdrawn

    @property
    def samples_unsure(self) -> int:
        """Lost samples that a crystal far off its rate would explain as well."""
        return self._placer.unsure

    @property
    def unseen_losses(self) -> str | None:
        """Why arrival times show no losses, and times count from the first sample; or None."""
        return self._placer.unseen

    @property
    def rate_fault(self) -> str | None:
        """The measured sample rate, with the remedy, if it is not the one requested."""
        return self._placer.rate_fault

    @property
    def sample_rate_hz(self) -> float:
        """Nominal sample rate [Hz]."""
        return self._rate_hz

    @property
    def center_frequency_hz(self) -> float:
        """Radio frequency at the middle of the received band [Hz]."""
        return self._center_hz

    @property
    def total_samples(self) -> int | None:
        """None: the length of a live stream is unknown."""
        return None


class DatagramSource(LiveSource):
    """Base of sources at a UDP port, ``udp://HOST:PORT``."""

    def _listen(self, address: str) -> None:
        """Open the port; raises `ConfigError` or `RadioError`."""
        self.name = address
        self._sockets = listen(*parse_udp_address(address))
        self._poll = select.poll()
        for sock in self._sockets:
            self._poll.register(sock, select.POLLIN)

    def close(self) -> None:
        """Close the port."""
        for sock in self._sockets:
            sock.close()
        self._sockets = []
