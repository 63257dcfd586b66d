"""Read the autopilot's parameters for ``uavrt doctor --autopilot``, and set them on request."""

import asyncio
from collections.abc import Iterator

from uavrt.core.errors import LinkError, UavrtError
from uavrt.drone.computer.autopilot_rules import (
    Need,
    has_serial_ports,
    names_to_read,
    needs,
    operator_failsafe,
)
from uavrt.drone.computer.finding import Finding, failed, passed
from uavrt.link.mavlink.autopilot.parameter_client import ParameterClient
from uavrt.link.mavlink.dialect import MavAutopilot
from uavrt.link.mavlink.links.address import Address, parse_address

LISTEN_S = 6.0
WHAT = "autopilot"
NAMES = {int(MavAutopilot.PX4): "PX4", int(MavAutopilot.ARDUPILOTMEGA): "ArduPilot"}


def examine_autopilot(
    address: str, *, port: str | None, baud: int | None = None, fix: bool = False
) -> Iterator[Finding]:
    """Check whether the autopilot's parameters have the values that uavrt needs.

    With `fix`, set the parameters that differ.
    """
    place = parse_address(address)
    if port is None and place.device:
        port = "TELEM2"
    try:
        yield from asyncio.run(_examine(place, port, baud or place.baud, fix))
    except UavrtError as error:
        remedy = error.remedy or "Try again"
        yield failed(WHAT, error.message, remedy)


def armed_by_link(address: str) -> bool | None:
    """Connect to the autopilot; True if it is armed, None if no autopilot answers.

    No other program may use the link.
    """

    async def ask() -> bool:
        async with ParameterClient.connected(parse_address(address), LISTEN_S) as client:
            return client.armed

    try:
        return asyncio.run(ask())
    except LinkError:
        return None


async def _examine(place: Address, port: str | None, baud: int, fix: bool) -> list[Finding]:
    async with ParameterClient.connected(place, LISTEN_S) as client:
        if client.kind not in NAMES:
            text = f"it is neither PX4 nor ArduPilot (MAV_AUTOPILOT {client.kind})"
            remedy = "Make it forward MAVLink between its ports; see the manual"
            return [failed(WHAT, text, remedy)]
        if fix and client.armed:
            text = "the vehicle is armed: nothing was set"
            remedy = "Disarm it and run this again, or leave out --fix to check only"
            return [failed(WHAT, text, remedy)]
        px4 = client.kind == MavAutopilot.PX4
        values = await client.read(names_to_read(px4, port))
        found = [_greeting(client, port)]
        changed = False
        for need in needs(px4, values, port, baud):
            finding, done = await _judge(client, need, fix)
            found.append(finding)
            changed = changed or done
        if px4 and not has_serial_ports(values):
            text = "this PX4 reports no serial ports (simulated?): forwarding was not checked"
            found.append(passed(WHAT, text))
        good, text, remedy = operator_failsafe(px4, values)
        found.append(Finding(what=WHAT, ok=good, text=text, remedy=remedy))
        if changed:
            text = "the changes take effect after a restart of the autopilot"
            remedy = "Switch the autopilot off and on, then run this again"
            found.append(failed(WHAT, text, remedy))
        return found


def _greeting(client: ParameterClient, port: str | None) -> Finding:
    where = "" if port is None else f", companion at {port}"
    name = NAMES[client.kind]
    return passed(WHAT, f"{name}, system {client.autopilot}{where}")


async def _judge(client: ParameterClient, need: Need, fix: bool) -> tuple[Finding, bool]:
    if need.met:
        return passed(WHAT, f"{need.name} = {need.needed:g}"), False
    if need.value is None:
        remedy = "Set the others and restart the autopilot, then run this again"
        text = f"{need.name} is not reported; {need.needed:g} is needed: {need.reason}"
        return failed(WHAT, text, remedy), False
    text = f"{need.name} = {need.value:g}, must be {need.needed:g}: {need.reason}"
    if not fix:
        remedy = f"Set it in your ground station, or with --fix ({need.name} = {need.needed:g})"
        return failed(WHAT, text, remedy), False
    now = await client.write(need.name, need.needed)
    if now == need.needed:
        text = f"{need.name} was {need.value:g}, is now {need.needed:g}: {need.reason}"
        return passed(WHAT, text), True
    remedy = "Set it in your ground station"
    return failed(WHAT, f"{text}; the autopilot did not accept it", remedy), False
