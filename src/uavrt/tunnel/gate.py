"""Who may command the drone, and how the ground seals its commands."""

from uavrt.clock import wall_ns
from uavrt.errors import LinkError, TunnelError
from uavrt.log import get_logger
from uavrt.tunnel.coded_tag import CODED_TAG_TYPE
from uavrt.tunnel.private import MOTION_TYPE, NEIGHBOUR_TYPE, RECEIPT_TYPE
from uavrt.tunnel.seal import (
    CODED_TAG_INSIDE,
    MOTION_INSIDE,
    NEIGHBOUR_INSIDE,
    PARAMETER_INSIDE,
    PLAIN_INSIDE,
    RECEIPT_INSIDE,
    Key,
    Place,
    SealKeeper,
    Session,
    parameter_inside,
    read_key,
    seal,
    session_of,
)

log = get_logger()


class Gate:
    """The drone's side.

    Parameters
    ----------
    commanders : tuple of int
        System ids that may command; empty: all.
    key_file : str, optional
        With a key only sealed commands are taken, unless that is not required.
    key_required : bool
        False: unsealed commands are taken, too; a sealed one comes from who has the key.

    Raises
    ------
    ConfigError
        The key cannot be read.
    """

    def __init__(
        self,
        commanders: tuple[int, ...] = (),
        key_file: str | None = None,
        *,
        key_required: bool = True,
    ) -> None:
        self._commanders = frozenset(commanders)
        self._key_required = key_required
        self._keeper = None if key_file is None else SealKeeper(read_key(key_file))
        self.refused = 0
        """Sealed messages that were forged, repeated or damaged."""

    @property
    def locked(self) -> bool:
        """Whether only sealed messages are taken."""
        return self._keeper is not None and self._key_required

    def refusal(self, sender: Place, *, sealed: bool) -> str | None:
        """Explain why a sender may not command; None if it may."""
        if self._commanders and sender[0] not in self._commanders:
            return f"system {sender[0]} may not command: see mavlink.commanders"
        if self.locked and not sealed:
            return "only sealed commands: this drone has a key"
        return None

    def announcement(self, drone: Place) -> bytes | None:
        """Write for what session commands must be sealed; None without a key."""
        return None if self._keeper is None else self._keeper.announcement(drone)

    def open(self, payload: bytes, sender: Place, drone: Place) -> tuple[int, bytes] | None:
        """Open a sealed payload; None (and counted) if it is not right."""
        if self._keeper is None:
            self.refused += 1
            return None
        try:
            return self._keeper.open(payload, sender, drone)
        except TunnelError as error:
            self.refused += 1
            log.seldom(self.refused, "sealed message refused", reason=error.message)
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
        self._session: Session | None = None
        self._last = 0

    @property
    def ready(self) -> bool:
        """Whether the drone has told its session."""
        return self._session is not None

    def hear(self, payload: bytes, drone: Place) -> None:
        """Take the session that a drone tells; raises `TunnelError` when it is not ours."""
        self._session, newest = session_of(payload, self._key, drone)
        self._last = max(self._last, newest)

    def __call__(self, payload: bytes, payload_type: int) -> bytes:
        """Seal a payload of type 0, a receipt, an order, a coded tag or a neighbour."""
        kinds = {
            RECEIPT_TYPE: RECEIPT_INSIDE,
            MOTION_TYPE: MOTION_INSIDE,
            CODED_TAG_TYPE: CODED_TAG_INSIDE,
            NEIGHBOUR_TYPE: NEIGHBOUR_INSIDE,
        }
        return self._seal(payload, kinds.get(payload_type, PLAIN_INSIDE))

    def parameter(self, name: str, value: float) -> bytes:
        """Seal the wish to set a parameter."""
        return self._seal(parameter_inside(name, value), PARAMETER_INSIDE)

    def _seal(self, inside: bytes, kind: int) -> bytes:
        if self._session is None:
            raise LinkError(
                "the drone has not told what to seal commands for",
                remedy="Check that it has mavlink.key_file with the same key",
            )
        self._last = max(self._last + 1, wall_ns() // 1000)
        return seal(inside, kind, self._key, self._own, self._last, self._session)
