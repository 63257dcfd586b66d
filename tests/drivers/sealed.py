"""Let a ground station's sealer learn a drone's session, as the two do over a link."""

from some import some

from uavrt.tunnel.gate import Gate, Sealer
from uavrt.tunnel.seal import Place, SealKeeper, alive_of


def introduce(sealer: Sealer, drone: Gate | SealKeeper, station: Place, place: Place) -> None:
    """Announce the session, and return the nonce that the station seals for it."""
    announced = some(drone.announcement(place))
    sealer.hear(announced, place)
    sealed = sealer.signs_of_life()[-1]
    opened = some(drone.open(sealed, station, place))
    echo = some(drone.announcement(place, alive_of(opened[1])[0]))
    sealer.hear(echo, place)
    assert sealer.ready
