"""Run the supervisor: ``python -m uavrt.supervisor SETTINGS_JSON``.

``uavrt run`` reads ``uavrt.toml`` and replaces itself by this program, so that the libraries
that check the settings do not stay in memory for the flight.
"""

import asyncio
import signal
import sys

import msgspec

from uavrt.config.settings import Settings
from uavrt.log import configure_logging, get_logger
from uavrt.supervisor.core import Supervisor
from uavrt.supervisor.viewers import Viewers


async def supervise(settings: Settings) -> None:
    """Run until SIGTERM or SIGINT."""
    viewers = Viewers()
    supervisor = Supervisor(settings, on_record=viewers.show)
    viewers.supervisor = supervisor
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, supervisor.stop)
    server = await viewers.serve(settings.status_socket) if settings.status_socket else None
    try:
        await supervisor.run()
    finally:
        if server is not None:
            server.close()


def main() -> int:
    """Run the supervisor with the settings of the first argument."""
    configure_logging("supervisor")
    settings = msgspec.json.decode(sys.argv[1], type=Settings)
    asyncio.run(supervise(settings))
    get_logger().info("all processes stopped")
    return 0


if __name__ == "__main__":
    sys.exit(main())
