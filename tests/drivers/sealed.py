"""Let a ground station's sealer learn a drone's session, as the two do over a link."""

from uavrt.tunnel import Gate, Sealer
from uavrt.tunnel.seal import Place, SealKeeper, alive_of


def introduce(sealer: Sealer, drone: Gate | SealKeeper, station: Place, place: Place) -> None:
    """Announce the session, and return the nonce that the station seals for it."""
    announced = drone.announcement(place)
    assert announced is not None
    sealer.hear(announced, place)
    sealed = sealer.signs_of_life()[-1]
    opened = drone.open(sealed, station, place)
    assert opened is not None
    echo = drone.announcement(place, alive_of(opened[1])[0])
    assert echo is not None
    sealer.hear(echo, place)
    assert sealer.ready
