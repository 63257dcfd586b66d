"""Base classes of live sources: sample rate, frequency, and numbering of samples."""

import select
from typing import ClassVar

from uavrt.core.errors import FormatError
from uavrt.radio.timing.sample_placing import Placer
from uavrt.radio.udp_address import listen, parse_udp_address

_MEGAHERTZ = (20.0, 10e3)
"""Range of entered frequencies that are taken as megahertz and refused; no radio tag transmits
at so few hertz."""
RADIO_RATE_REMEDY = (
    "Check the radio's cable and this computer's load, or set [radio] sample_rate_hz to a "
    "rate that the radio supports"
)
"""Remedy in the error for a radio that delivers samples at a wrong rate."""


def check_rates(sample_rate_hz: float, center_frequency_hz: float) -> None:
    """Raise `FormatError` if the sample rate or the radio frequency is impossible."""
    if not 0.0 < sample_rate_hz < 1e9:
        raise FormatError(
            f"the sample rate of {sample_rate_hz} Hz is not possible",
            remedy="Give --sample-rate in samples per second, e.g. 3000000",
        )
    if _MEGAHERTZ[0] <= center_frequency_hz < _MEGAHERTZ[1]:
        raise FormatError(
            f"the center frequency of {center_frequency_hz:g} Hz looks like a value in "
            "megahertz",
            remedy=f"Give --center-frequency {center_frequency_hz:g}e6",
        )
    if not 0.0 <= center_frequency_hz < 1e12:
        raise FormatError(
            f"the center frequency of {center_frequency_hz} Hz is not possible",
            remedy="Give --center-frequency in hertz, e.g. 148.7e6",
        )


class LiveSource:
    """Base class of sources without a known end, such as radios, pipes and UDP ports.

    `start_time_ns`: time of the first sample [ns, UTC]; all later times then follow from the
    nominal rate. `start_moves`: correct the start time if the first arrivals were delayed.
    Raises `FormatError` for an impossible rate.
    """

    MAY_BE_SLOW: ClassVar[bool] = False
    """True if the sender may be slower than real time: late samples are then no loss."""
    RATE_REMEDY: ClassVar[str] = "Set the sample rate to the one that the sender uses"
    """Remedy in the error for samples that arrive at a wrong rate."""

    def __init__(
        self,
        sample_rate_hz: float,
        center_frequency_hz: float,
        start_time_ns: int | None = None,
        *,
        start_moves: bool = True,
    ) -> None:
        check_rates(sample_rate_hz, center_frequency_hz)
        self.sample_rate_hz = sample_rate_hz
        """Nominal sample rate [Hz]."""
        self.center_frequency_hz = center_frequency_hz
        """Radio frequency at the middle of the received band [Hz]."""
        self.total_samples: int | None = None
        """Always None, because the length of a live stream is unknown."""
        self._placer = Placer(
            sample_rate_hz,
            start_time_ns=start_time_ns,
            start_moves=start_moves,
            may_be_slow=self.MAY_BE_SLOW,
            rate_remedy=self.RATE_REMEDY,
        )

    @property
    def samples_lost(self) -> int:
        """Number of lost samples, as reported by the radio or found from arrival times."""
        return self._placer.lost

    @property
    def lost_withdrawn(self) -> int:
        """Number of samples wrongly counted as lost, because the sender is not a live radio.

        The sender proved to be slower or quicker than real time, so its arrival times show no
        losses.
        """
        return self._placer.withdrawn

    @property
    def unseen_losses(self) -> str | None:
        """Reason why arrival times cannot be used to find losses; None if they can."""
        return self._placer.unseen

    @property
    def rate_fault(self) -> str | None:
        """Text with the measured sample rate and a remedy; None if the rate is correct."""
        return self._placer.rate_fault


class DatagramSource(LiveSource):
    """Base class of sources that receive datagrams at a UDP port, ``udp://HOST:PORT``."""

    def _listen(self, address: str) -> None:
        self.name = address
        self._sockets = listen(*parse_udp_address(address))
        self._poll = select.poll()
        for sock in self._sockets:
            self._poll.register(sock, select.POLLIN)

    def close(self) -> None:
        """Close the sockets of the UDP port."""
        for sock in self._sockets:
            sock.close()
        self._sockets = []
