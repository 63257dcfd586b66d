"""Who may command the drone; and the ground's pen for the seal."""

from uavrt.clock import wall_ns
from uavrt.errors import TunnelError
from uavrt.log import get_logger
from uavrt.tunnel.private import RECEIPT_TYPE
from uavrt.tunnel.seal import (
    PARAMETER_INSIDE,
    PLAIN_INSIDE,
    RECEIPT_INSIDE,
    Key,
    Place,
    SealKeeper,
    parameter_inside,
    read_key,
    seal,
)

log = get_logger()


class Gate:
    """The drone's side.

    Parameters
    ----------
    commanders : tuple of int
        System ids that may command; empty: all.
    key_file : str, optional
        With a key only sealed commands are taken.

    Raises
    ------
    ConfigError
        The key cannot be read.
    """

    def __init__(self, commanders: tuple[int, ...] = (), key_file: str | None = None) -> None:
        self._commanders = frozenset(commanders)
        self._keeper = None if key_file is None else SealKeeper(read_key(key_file))
        self.refused = 0
        """Sealed messages that were forged, repeated or damaged."""

    @property
    def locked(self) -> bool:
        """Whether only sealed messages are taken."""
        return self._keeper is not None

    def refusal(self, sender: Place, *, sealed: bool) -> str | None:
        """Say why a sender may not command; None if it may."""
        if self._commanders and sender[0] not in self._commanders:
            return f"system {sender[0]} may not command: see mavlink.commanders"
        if self.locked and not sealed:
            return "only sealed commands: this drone has a key"
        return None

    def open(self, payload: bytes, sender: Place, now_ns: int) -> tuple[int, bytes] | None:
        """Open a sealed payload; None (and counted) if it is not right."""
        if self._keeper is None:
            self.refused += 1
            return None
        try:
            return self._keeper.open(payload, sender, now_ns // 1000)
        except TunnelError as error:
            self.refused += 1
            log.warning("sealed message refused", reason=error.message)
            return None


class Sealer:
    """The ground's side: seals what it sends.

    Parameters
    ----------
    key : Key
        The shared secret.
    own : (int, int)
        Our system and component id.
    """

    def __init__(self, key: Key, own: Place) -> None:
        self._key = key
        self._own = own
        self._last_us = 0

    def __call__(self, payload: bytes, payload_type: int) -> bytes:
        """Seal a payload of type 0 or a receipt."""
        return self._seal(
            payload, RECEIPT_INSIDE if payload_type == RECEIPT_TYPE else PLAIN_INSIDE
        )

    def parameter(self, name: str, value: float) -> bytes:
        """Seal the wish to set a parameter."""
        return self._seal(parameter_inside(name, value), PARAMETER_INSIDE)

    def _seal(self, inside: bytes, kind: int) -> bytes:
        self._last_us = max(self._last_us + 1, wall_ns() // 1000)
        return seal(inside, kind, self._key, self._own, self._last_us)
