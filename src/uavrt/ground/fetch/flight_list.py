"""List the flights on the drone in the order in which they were flown, recorded in a file
(`uavrt.flight.flight_order`), as the drone's clock may start in 1970.
"""

from pathlib import PurePosixPath

from uavrt.core.errors import LinkError
from uavrt.flight.flight_order import FLIGHT_ORDER, FLIGHT_PREFIX, flown_name, names_in_order
from uavrt.ground.fetch.ftp_client import FileClient, RemoteEntry

MOST_NOTED = 8_000
"""Bytes read from the end of the drone's list of flights: some 250 names, 2 s by radio."""


async def drone_flights(client: FileClient) -> list[str]:
    """List the names of the flights on the drone, the oldest first; raises `LinkError`."""
    entries = await client.list_directory("/")
    names = [
        name
        for name in (PurePosixPath(entry.path).name for entry in entries if entry.size is None)
        # Not what a page on the drone received of them.
        if name.startswith(FLIGHT_PREFIX) and flown_name(name) == name
    ]
    noted = [one for one in entries if one.path == f"/{FLIGHT_ORDER}" and one.size is not None]
    return names_in_order(names, await _noted(client, noted[0]) if noted else [])


async def _noted(client: FileClient, entry: RemoteEntry) -> list[str]:
    """Read the last names in the drone's list of flights; empty if the drone has no list."""
    got = bytearray()
    start = max(0, (entry.size or 0) - MOST_NOTED)

    def allow(size: int) -> None:
        if size - start > 2 * MOST_NOTED:
            raise LinkError(
                f"the drone listed {entry.path} with {entry.size} bytes, but sent {size}"
            )

    async def keep(data: bytes) -> None:
        got.extend(data)

    try:
        await client.read(entry.path, keep, start=start, allow=allow)
    except LinkError:
        return []
    return bytes(got).decode(errors="replace").splitlines()
