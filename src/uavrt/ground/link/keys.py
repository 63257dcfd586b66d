"""Component id and secret keys with which a ground station identifies itself to a drone."""

from dataclasses import dataclass
from pathlib import Path

from uavrt.core.errors import ConfigError
from uavrt.ground.link.vehicles.vehicle_identity import DRONE_COMPONENT
from uavrt.link.mavlink.sending.signing import SigningKey, read_signing_key
from uavrt.link.tunnel.own_messages.seal import Key, read_key


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkKeys:
    """MAVLink component id of a ground station, and up to two secret keys."""

    component_id: int = 190
    """MAVLink component id in system 254, usually 190. Stations of the same drone need
    different ids, since the drone answers each component on one link only."""
    as_gcs: bool = False
    """Use system 255 and type GCS, which the original system's drone side requires."""
    command: Key | None = None
    """Key that authenticates commands by their content, which PX4 forwards unchanged; or
    None."""
    signing: SigningKey | None = None
    """Key of MAVLink 2 frame signing; None: frames are not signed."""


NO_KEYS: LinkKeys = LinkKeys()


def read_link_keys(
    command: Path | None, signing: Path | None, component_id: int = 190, *, as_gcs: bool = False
) -> LinkKeys:
    """Read the keys from their files; raises `ConfigError` if one is invalid."""
    if not 2 <= component_id <= 255 or component_id == DRONE_COMPONENT:
        raise ConfigError(
            f"{component_id} is not a valid component id for a ground station",
            remedy=f"Use one from 2 to 255, but not the drone side's {DRONE_COMPONENT}",
        )
    return LinkKeys(
        component_id=component_id,
        as_gcs=as_gcs,
        command=None if command is None else read_key(command),
        signing=None if signing is None else read_signing_key(signing),
    )
