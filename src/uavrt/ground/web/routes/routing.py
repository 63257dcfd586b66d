"""Route HTTP requests to their functions; encode answers and errors."""

from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple
from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from uavrt.core.errors import CommandRefused, FormatError, LinkError, NotFound, UavrtError
from uavrt.ground.commanding_page import CommandingPage
from uavrt.ground.page_listeners import encode
from uavrt.ground.web.work.foreign_requests import read_body, read_object

Handler = Callable[[Request], Awaitable[Any]]
"""Function that answers a request; it returns a value for JSON, an `Answer` or a response."""


class Row(NamedTuple):
    """One route of the page's server: path, method and function."""

    path: str
    """Path of the route below ``/api``."""
    method: str
    handle: Handler
    commands: bool = False
    """True if only the commanding page may request it."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A value to be sent with an HTTP status other than 200."""

    status: int
    value: Any


def made(rows: Iterable[Row], commander: CommandingPage) -> list[Route]:
    """Make the web server's routes below ``/api`` from rows of `Row`."""
    return [
        Route(
            f"/api{row.path}",
            answered(_by(commander, row.handle) if row.commands else row.handle),
            methods=[row.method],
        )
        for row in rows
    ]


def page_of(request: Request) -> str | None:
    """Name of the requesting page; None for a script."""
    return request.headers.get("x-page")


def _by(commander: CommandingPage, handle: Handler) -> Handler:
    async def handle_by_commander(request: Request) -> Any:
        commander.check(page_of(request))
        return await handle(request)

    return handle_by_commander


def answered(handle: Handler) -> Callable[[Request], Any]:
    """Answer with a value as JSON, or with an expected error and its remedy."""

    async def answer(request: Request) -> Response:
        try:
            value = await handle(request)
        except (LinkError, CommandRefused) as error:
            return _json_response({"error": str(error)}, 409)
        except UavrtError as error:
            status = 404 if isinstance(error, NotFound) else 422
            return _json_response({"error": str(error)}, status)
        except OSError as error:
            named = "" if error.filename is None else f"{str(error.filename)[-80:]}: "
            return _json_response({"error": f"{named}{error.strerror or error}"}, 422)
        if isinstance(value, Response):
            return value
        if isinstance(value, Answer):
            return _json_response(value.value, value.status)
        return _json_response(value, 200)

    return answer


def _json_response(value: Any, status: int) -> Response:
    return Response(encode(value), status, media_type="application/json")


async def json_body(request: Request) -> Any:
    """Parse the request body as JSON; raises `FormatError`."""
    return read_body(await request.body())


async def json_object(request: Request) -> dict[str, Any]:
    """Parse the request body as a JSON object; raises `FormatError`."""
    return read_object(await request.body())


def whole_number(request: Request, name: str, default: int, most: int) -> int:
    """Read an integer from the query string; raises `FormatError`."""
    text = request.query_params.get(name, str(default))
    if not text.isascii() or not text.isdigit():
        raise FormatError(f"{name} must be a whole number")
    return min(int(text[:12]), most)


def download(content: bytes, name: str, kind: str) -> Response:
    """Build an answer that the browser saves as a file."""
    # RFC 6266: headers are Latin; the name in full comes percent-encoded.
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "_" for c in name)
    disposition = f"attachment; filename=\"{plain}\"; filename*=UTF-8''{quote(name, safe='')}"
    return Response(content, media_type=kind, headers={"Content-Disposition": disposition})
