"""HTTP and WebSocket server of the ground station: sockets, access control and page. It needs
the extra ``uavrt[ground]``, so only ``uavrt ground`` with a page imports it.
"""

import asyncio
import contextlib
import socket
import ssl
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import Receive, Scope, Send

from uavrt.core.errors import ConfigError, LinkError
from uavrt.core.foreign import KEYS, read_file
from uavrt.ground.fleet import Fleet
from uavrt.ground.session import GroundSession
from uavrt.ground.web.access.access_qr import Served, access_list
from uavrt.ground.web.access.connection_limits import (
    ListeningSocket,
    connections_limited,
    limited_protocol,
)
from uavrt.ground.web.access.guard import Guard
from uavrt.ground.web.routes import map_routes as maps
from uavrt.ground.web.routes.api import api_rows
from uavrt.ground.web.routes.drone_flights import ExtraApi
from uavrt.ground.web.routes.fleet_api import FleetApi
from uavrt.ground.web.routes.flight_lists import FlightListApi
from uavrt.ground.web.routes.page_records import send_records
from uavrt.ground.web.routes.routing import Handler, answered, made
from uavrt.ground.web.routes.set_up_api import set_up_rows
from uavrt.ground.web.work.foreign_worker import ForeignWorker

STATIC = Path(__file__).parents[1] / "static"
DEFAULT_PORT = 8650
SETTLE_S = 1.0
_NO_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8">
<title>uavrt ground station</title><h1>The page is not built</h1>
<p>This installation was made without its page, because npm could not be reached. The server
works; scripts can use <a href="/api/state">/api/state</a> and its neighbours.</p>
<p>To build the page, with internet, in the clone: <code>pip install -e .</code></p>
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerSettings:
    """Address, access control and files of the page's server."""

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    """TCP port; 0 takes any free one."""
    names: frozenset[str] = frozenset()
    """Host names accepted in requests, in addition to the local ones."""
    password: str | None = None
    certificate: Path | None = None
    key: Path | None = None
    access_point: str | None = None
    """Text by which phones join this computer's own Wi-Fi,
    ``WIFI:T:WPA;S:name;P:password;;``; None without one."""
    drone_settings: Path | None = None
    """``uavrt.toml`` of the drone side on this computer, which the page may set up; None: no
    set-up."""


def listening_socket(settings: ServerSettings) -> ListeningSocket:
    """Bind the server's socket, so that a busy port is reported before anything starts."""
    _check_certificate(settings)
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    sock = ListeningSocket(family)
    try:
        # Not on Windows, where it lets two servers share a port.
        if hasattr(socket, "SO_REUSEPORT"):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind((settings.host, settings.port))
        sock.listen(64)
    except OSError as error:
        sock.close()
        raise LinkError(
            f"the page cannot be served at {settings.host} port {settings.port}: "
            f"{error.strerror}",
            remedy="Another ground station may be running; open its page, or give --port",
        ) from error
    return sock


def _check_certificate(settings: ServerSettings) -> None:
    """Raise `ConfigError` for an unusable certificate or key, before anything starts."""
    if settings.certificate is None:
        if settings.key is not None:
            raise ConfigError(
                "--key is given without a certificate", remedy="Also give --certificate"
            )
        return
    for path in (settings.certificate, settings.key):
        if path is not None:
            try:
                read_file(path, KEYS)  # OpenSSL takes any length
            except OSError as error:
                reason = f"{path} cannot be read: {error.strerror}"
                raise ConfigError(reason, remedy="Check the file's name") from error
    try:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(settings.certificate, settings.key, _no_pass_phrase)
    except OSError as error:
        raise ConfigError(
            f"{settings.certificate} is not a certificate (PEM) with its key",
            remedy="Give the certificate with --certificate, and its key with --key",
        ) from error


def _no_pass_phrase() -> str:
    """Raise `ConfigError` for an encrypted key, so that OpenSSL does not prompt."""
    remedy = "Write it without one: openssl pkey -in KEY -out NEW"
    raise ConfigError("the page's key is protected by a pass phrase", remedy=remedy)


class PageServer(uvicorn.Server):
    """Uvicorn server that does not handle signals such as SIGINT."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Do not capture signals, because ``uavrt ground`` handles them itself."""
        yield

    async def serve(self, sockets: list[socket.socket] | None = None) -> None:
        """Serve the page, with a limited number of connections per client."""
        entrance = sockets[0] if sockets else None
        assert isinstance(entrance, ListeningSocket)
        self.config.http = limited_protocol(entrance)
        try:
            with connections_limited(entrance):
                await super().serve(sockets)
        finally:
            assert isinstance(self.config.app, Starlette)
            self.config.app.state.foreign.close()


def page_server(fleet: Fleet, settings: ServerSettings) -> PageServer:
    """Make the server; serve it with ``serve(sockets=[listening_socket(settings)])``."""
    return PageServer(
        uvicorn.Config(
            application(fleet.first, settings, fleet),
            log_config=None,
            access_log=False,
            lifespan="off",
            ws="websockets-sansio",
            ws_max_size=4096,
            ssl_certfile=settings.certificate,
            ssl_keyfile=settings.key,
            timeout_graceful_shutdown=2,
            server_header=False,
        )
    )


def application(
    session: GroundSession, settings: ServerSettings, fleet: Fleet | None = None
) -> Starlette:
    """Make the web application of a session and of the further vehicles of its fleet."""
    worker = ForeignWorker()
    guard = Middleware(Guard, hosts=settings.names, password=settings.password)
    routes = _routes(session, worker, settings.drone_settings)
    routes += made(set_up_rows(session, settings.drone_settings), session.commander)
    if fleet is not None:
        routes += made(FleetApi(fleet).routes(), session.commander)
        routes.append(Mount("/vehicle/{number:int}", FurtherVehicles(fleet, worker)))
    routes.append(Route("/api/doors", answered(_access_route(settings))))
    routes += maps.map_routes(session.vehicle.store.directory / "maps", worker)
    if (STATIC / "assets").is_dir():
        assets = _Assets(directory=STATIC / "assets", follow_symlink=False)
        routes.append(Mount("/assets", assets))
    served = Starlette(routes=routes, middleware=[guard])
    served.state.foreign = worker
    return served


def _access_route(settings: ServerSettings) -> Handler:
    served = Served(
        host=settings.host, names=settings.names, access_point=settings.access_point
    )

    async def access_reply(request: Request) -> Any:
        return access_list(served, request.url)

    return access_reply


def _routes(
    session: GroundSession, worker: ForeignWorker, drone_settings: Path | None = None
) -> list[Route | Mount | WebSocketRoute]:
    """Routes of the page and of one session."""
    routes: list[Route | Mount | WebSocketRoute] = [
        Route("/", _page),
        WebSocketRoute("/api/records", partial(send_records, session)),
    ]
    rows = [
        *api_rows(session, worker, drone_settings),
        *ExtraApi(session).routes(),
        *FlightListApi(session, worker).routes(),
    ]
    ready = (
        row._replace(handle=_with_flights_written(session, row.handle))
        if "flights" in row.path
        else row
        for row in rows
    )
    return routes + made(ready, session.commander)


def _with_flights_written(session: GroundSession, handler: Handler) -> Handler:
    """Write pending flights to disk before a handler runs, unless the disk is slow."""

    async def handle(request: Request) -> Any:
        vehicles = (session.vehicle, *session.vehicle.companions)
        await asyncio.gather(*(one.flight.keeper.queue.settle(SETTLE_S) for one in vehicles))
        return await handler(request)

    return handle


class FurtherVehicles:
    """Serves the page of each further vehicle below ``/vehicle/NUMBER``."""

    def __init__(self, fleet: Fleet, worker: ForeignWorker) -> None:
        self._fleet, self._worker = fleet, worker
        self._made: dict[int, tuple[GroundSession, Starlette]] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on to its vehicle's application."""
        number = int(scope["path_params"]["number"])
        session = self._fleet.session(number)
        if session is None:
            self._made.pop(number, None)
            if scope["type"] == "websocket":
                await send({"type": "websocket.close", "code": 1008})
                return
            answer = JSONResponse({"error": f"vehicle {number} is not served here"}, 404)
            await answer(scope, receive, send)
            return
        kept = self._made.get(number)
        if kept is None or kept[0] is not session:
            kept = session, Starlette(routes=_routes(session, self._worker))
            self._made[number] = kept
        await kept[1](scope, receive, send)


class _Assets(StaticFiles):
    """Serves built files, whose names contain their hash, so that they never change."""

    def file_response(self, *args: Any, **kwargs: Any) -> Response:
        """Return a file that the browser may cache."""
        response = super().file_response(*args, **kwargs)
        response.headers["Cache-Control"] = "public, max-age=31536000, immutable"
        return response


async def _page(request: Request) -> Response:
    index = STATIC / "index.html"
    if not index.is_file():
        return HTMLResponse(_NO_PAGE)
    return HTMLResponse(index.read_bytes(), headers={"Cache-Control": "no-cache"})


__all__ = [
    "DEFAULT_PORT",
    "PageServer",
    "ServerSettings",
    "application",
    "listening_socket",
    "page_server",
]
