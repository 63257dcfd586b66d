"""Let a ground station's sealer learn a drone's session, as the two do over a link."""

from some import some

from uavrt.link.tunnel.gate import Gate, Sealer
from uavrt.link.tunnel.generations.wire import Ids
from uavrt.link.tunnel.own_messages.seal import SealKeeper, read_keepalive


def introduce(sealer: Sealer, drone: Gate | SealKeeper, station: Ids, place: Ids) -> None:
    """Announce the session, and return the nonce that the station seals for it."""
    announced = some(drone.announcement(place))
    sealer.accept_session(announced, place)
    sealed = sealer.keepalives()[-1]
    opened = some(drone.open(sealed, station, place))
    echo = some(drone.announcement(place, read_keepalive(opened[1])[0]))
    sealer.accept_session(echo, place)
    assert sealer.ready
