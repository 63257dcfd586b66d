"""Check whether the drone's messages arrive, and explain why not."""

import asyncio

from uavrt.core.errors import LinkError
from uavrt.ground.link.vehicles.vehicle_identity import DRONE_COMPONENT
from uavrt.link.mavlink.autopilot.waiting import within
from uavrt.link.mavlink.frame import Frame
from uavrt.link.mavlink.sending.signing import Signing


class DroneContact:
    """Checks signatures if `signing` is given; explains missing contact with the drone."""

    def __init__(self, signing: Signing | None) -> None:
        self._signing = signing
        self._drone_signs = self._drone_refused = False
        self.made = asyncio.Event()

    @property
    def refused(self) -> dict[str, int]:
        """Number of frames refused for their signature, by reason."""
        return {} if self._signing is None else dict(self._signing.counters)

    def accepts(self, frame: Frame) -> bool:
        """True if a frame's signature is valid, or none is required."""
        from_drone = frame.component_id == DRONE_COMPONENT
        if from_drone:
            self._drone_signs = frame.signed
        accepted = self._signing is None or self._signing.accepts(frame)
        self._drone_refused |= from_drone and not accepted
        return accepted

    async def wait(self, timeout_s: float) -> None:
        """Wait for a message of the drone; raises `LinkError` if none arrives in time."""
        if not await within(timeout_s, self.made.wait()):
            raise self._missing()

    def _missing(self) -> LinkError:
        """Make the error for missing contact: no messages arrive, or the key is wrong."""
        if self._drone_refused:
            return LinkError(
                f"the drone (component {DRONE_COMPONENT}) sends messages, but does not sign "
                "them with the given key",
                remedy="Give the key in the drone's mavlink.signing_key_file, or no key if "
                "the drone has none",
            )
        return LinkError(
            f"no messages from a drone arrive (MAVLink component {DRONE_COMPONENT})",
            remedy="Check the drone's power, the radio, and that the autopilot forwards "
            "MAVLink between its companion and ground ports",
        )

    def unanswered(self, number: int, waited_s: float) -> LinkError:
        """Make the error for an unanswered command: drone silent, or signatures required."""
        text = f"the drone did not answer command {number} in {waited_s:g} s"
        if self._drone_signs and self._signing is None:
            return LinkError(
                f"{text}: the drone signs its frames and may accept only signed ones",
                remedy="Give the drone's key with --signing-key",
            )
        return LinkError(
            text, remedy="Check the radio link and try again; repeated commands do no harm"
        )
