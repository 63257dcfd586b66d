"""Restrict the server to this machine's own page and scripts; refuse other web sites. A site
open in the same browser could send requests here (cross-site request forgery) or point its name
at this machine (DNS rebinding). So a request's host must be ours, and an origin, which scripts
do not send, the same host and port. Requests that use the drone's radio must be POST.
"""

import hmac
import ipaddress
import secrets
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from uavrt.ground.web.access.password_limit import PasswordLimit

LOCAL_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]"})
COOKIE = "uavrt_ground"
MAX_BODY = 4_000_000

SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
        "connect-src 'self'; worker-src 'self'; font-src 'self'; manifest-src 'self'; "
        "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    # Not "no-referrer", with which browsers send our own form as from nowhere ("Origin: null").
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}

_LOGIN = """<!doctype html><html lang="{language}"><meta charset="utf-8">
<meta name="viewport" content="width=device-width"><title>uavrt {title}</title>
<h1>{title}</h1><form method="post" action="/login">
<label>{password} <input type="password" name="password" autofocus required></label>
<button>{open}</button></form><p role="alert">{fault}</p>"""
_WORDS = {
    "en": {
        "title": "Ground station",
        "password": "Password",
        "open": "Open",
        "wrong": "This is not the password.",
        "wait": "Too many wrong passwords: try again in {seconds} s.",
    },
    "de": {
        "title": "Bodenstation",
        "password": "Passwort",
        "open": "Öffnen",
        "wrong": "Das ist nicht das Passwort.",
        "wait": "Zu viele falsche Passwörter: in {seconds} s wieder versuchen.",
    },
}
"""Texts of the password form, which is shown before the page's translations may be loaded."""


class Guard:
    """ASGI middleware: checks host, origin and password, and adds security headers.

    IP addresses of this machine are allowed as hosts if a password is set.
    """

    def __init__(
        self, app: ASGIApp, *, hosts: frozenset[str] = frozenset(), password: str | None = None
    ) -> None:
        self._app = app
        self._hosts = LOCAL_NAMES | {host.lower() for host in hosts}
        self._password = password
        self.guesses = PasswordLimit()
        self._session = secrets.token_urlsafe(32)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check a request to the page's server, then serve or refuse it (ASGI interface)."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        fault = self._fault(scope)
        if fault is None and scope["type"] == "websocket" and not self._may(scope):
            fault = "the request has no valid password"
        if fault is not None:
            await _refuse(fault, scope, receive, send)
        elif scope["type"] == "websocket":
            await self._app(scope, receive, send)
        elif not self._may(scope):
            await self._login(scope, receive, _with_headers(send))
        else:
            await self._bounded(scope, receive, send)

    async def _bounded(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request; abort it if its body exceeds `MAX_BODY`."""
        taken = 0

        async def receive_bounded() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if taken > MAX_BODY and not _is_map(scope):
                raise _TooLargeError
            return message

        try:
            await self._app(scope, receive_bounded, _with_headers(send))
        except _TooLargeError:
            answer = JSONResponse(
                {"error": "the request is too large"}, 413, headers={"Connection": "close"}
            )
            await answer(scope, receive, _with_headers(send))

    def _may(self, scope: Scope) -> bool:
        return self._password is None or self._known(scope)

    def _fault(self, scope: Scope) -> str | None:
        """Reason why a request is refused; None if it is allowed."""
        headers = Headers(scope=scope)
        host = headers.get("host", "").lower()
        if not self._is_ours(host):
            return f"this server does not serve {host[:80]!r}: use this computer's address"
        origin = headers.get("origin")
        if origin is not None:
            scheme, _, place = origin.lower().partition("://")
            secure = scope["scheme"] in ("https", "wss")
            if scheme != ("https" if secure else "http") or place != host:
                return f"requests from {origin[:80]!r} are refused"
        site = headers.get("sec-fetch-site")
        asks = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        # Another site may link to the page, and fetch nothing of it.
        if (asks or scope["path"] != "/") and site not in (None, "same-origin", "none"):
            return "requests from other sites are refused"
        if scope["type"] == "websocket":
            return None
        if int(headers.get("content-length") or 0) > MAX_BODY and not _is_map(scope):
            return "the request is too large"
        kind = headers.get("content-type", "").partition(";")[0].strip()
        plain = scope["path"] == "/login" or _is_map(scope)
        if asks and not plain and kind != "application/json":
            # A form of another site cannot send JSON without asking first.
            return "commands must be sent as application/json"
        return None

    def _is_ours(self, host: str) -> bool:
        name = host.rpartition(":")[0] if host.rpartition(":")[2].isdigit() else host
        if name in self._hosts:
            return True
        if self._password is None:
            return False
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return True  # a rebound name is never an address

    def _known(self, scope: Scope) -> bool:
        headers = Headers(scope=scope)
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            cookie = None
        if cookie is not None and _equal(cookie.value, self._session):
            return True
        kind, _, bearer = headers.get("authorization", "").partition(" ")
        return kind == "Bearer" and self._right(bearer, scope)

    def _right(self, given: str, scope: Scope) -> bool:
        """True for the right password; after too many wrong ones False without a check."""
        assert self._password is not None
        address = _address(scope)
        if self.guesses.wait_s(address) > 0.0:
            return False
        right = _equal(given, self._password)
        if not right:
            self.guesses.wrong(address)
        return right

    async def _login(self, scope: Scope, receive: Receive, send: Send) -> None:
        response: Response
        wait_s = self.guesses.wait_s(_address(scope))
        for_scripts = scope["path"].startswith("/api/")
        if wait_s > 0.0:
            seconds = f"{wait_s:.0f}"
            text = f"too many wrong passwords: try again in {seconds} s"
            response = (
                JSONResponse({"error": text}, 429)
                if for_scripts
                else HTMLResponse(_form(scope, "wait", seconds=seconds), 429)
            )
            response.headers["Retry-After"] = seconds
        elif scope["path"] == "/login" and scope["method"] == "POST":
            body = await _body(receive)
            given = parse_qs(body.decode("utf-8", "replace")).get("password", [""])[0]
            if self._right(given, scope):
                response = RedirectResponse("/", 303)
                response.set_cookie(
                    COOKIE,
                    self._session,
                    httponly=True,
                    samesite="strict",
                    secure=scope["scheme"] == "https",
                )
            else:
                response = HTMLResponse(_form(scope, "wrong"), 401)
        elif for_scripts:
            response = JSONResponse({"error": "the request has no valid password"}, 401)
        else:
            response = HTMLResponse(_form(scope), 401)
        await response(scope, receive, send)


def _form(scope: Scope, fault: str = "", **gaps: str) -> str:
    """Write the password form in the browser's first supported language."""
    wanted = Headers(scope=scope).get("accept-language", "").lower().split(",")
    known = (one.strip()[:2] for one in wanted)
    language = next((one for one in known if one in _WORDS), "en")
    words = _WORDS[language]
    text = words[fault].format(**gaps) if fault else ""
    return _LOGIN.format(language=language, fault=text, **words)


async def _body(receive: Receive) -> bytes:
    body: bytes = b""
    while True:
        message = await receive()
        body += bytes(message.get("body", b""))
        if not message.get("more_body") or len(body) > 10_000:
            return body


def _is_map(scope: Scope) -> bool:
    """True for an upload of a map file; forms of other sites cannot use its method."""
    return scope["method"] == "PUT" and str(scope["path"]).startswith("/api/maps/")


class _TooLargeError(Exception):
    """Raised for a request body beyond the size limit."""


def _address(scope: Scope) -> str:
    client = scope.get("client")
    return str(client[0]) if client else ""


def _equal(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode(), wanted.encode())


async def _refuse(fault: str, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": fault[:100]})
        return
    await JSONResponse({"error": fault}, 403)(scope, receive, _with_headers(send))


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in SECURITY_HEADERS.items():
                headers.setdefault(name, value)
            headers.setdefault("Cache-Control", "no-store")
        await send(message)

    return send_with_headers
