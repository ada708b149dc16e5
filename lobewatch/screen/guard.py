"""Who may ask for what: Host, Origin and token of every request, and the headers of every answer."""

from __future__ import annotations

import hmac
import ipaddress
import logging
import re
import secrets
from dataclasses import dataclass

from aiohttp import web
from aiohttp.typedefs import Handler, Middleware
from yarl import URL

from acquisition.errors import failure_text
from lobewatch.screen.door import Door

OPEN = "open-"
"""Beginning of the name of a route that answers without a token; it must neither tell nor alter anything."""
WATCH = "watch-"
"""Beginning of the name of a route that alters nothing although it is not asked by GET."""
MAY_ALTER = web.RequestKey("MAY_ALTER", bool)
"""Whether the token of a request is the full one."""
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_log = logging.getLogger(__name__)


def checked_token(token: str | None) -> str:
    """Token that fits into an address and a header; a new one for None. ValueError for one that does not fit."""
    if token is None:
        return secrets.token_urlsafe(24)
    if not re.fullmatch(r"[A-Za-z0-9_-]{12,200}", token):
        raise ValueError("the token must be 12 to 200 characters of A-Z, a-z, 0-9, _ and -; leave it out for a new one")
    return token


@dataclass(frozen=True)
class Tokens:
    """Tokens, one of which a browser must know."""

    full: str
    """Token to see and alter."""
    watch: str
    """Token only to see."""


def checked_tokens(full: str | None, watch: str | None) -> Tokens:
    """Both tokens, each a new one for None. ValueError for one that does not fit into an address, and for one twice."""
    tokens = Tokens(checked_token(full), checked_token(watch))
    if tokens.full == tokens.watch:
        raise ValueError("the token to watch is the full one too; give two different ones, or leave one out")
    return tokens


def guarded_application(tokens: Tokens, listen: str, door: Door) -> web.Application:
    """Application that answers only to its own page, tells nothing without a token, alters nothing without the
    full one."""
    application = web.Application(middlewares=[_attend(door), _guard(tokens, listen, door)], client_max_size=4096)
    application.on_response_prepare.append(_add_headers)
    return application


async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
    for name, value in HEADERS.items():
        response.headers.setdefault(name, value)


def _attend(door: Door) -> Middleware:
    @web.middleware
    async def attend(request: web.Request, handler: Handler) -> web.StreamResponse:
        """Answer a request whose head has come; its connection is not hung up before."""
        async with door.attending(request):
            return await handler(request)

    return attend


def _guard(tokens: Tokens, listen: str, door: Door) -> Middleware:
    @web.middleware
    async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            _check_host(request, listen)
            _check_origin(request)
            name = request.match_info.route.name or ""
            if not name.startswith(OPEN):
                _check_token(request, tokens, alters=request.method != "GET" and not name.startswith(WATCH))
                door.trust(request)
            return await handler(request)
        except web.HTTPException as refusal:
            return web.json_response({"error": refusal.text or refusal.reason}, status=refusal.status)
        except (ValueError, OSError) as error:
            return web.json_response({"error": failure_text(error)}, status=409)
        except Exception:  # noqa: BLE001 - the page must not see a traceback, the log must
            _log.exception("%s %s failed", request.method, request.path)
            return web.json_response({"error": "lobewatch failed here; see its terminal"}, status=500)

    return guard


def _check_host(request: web.Request, listen: str) -> None:
    """Refuse a host that is no address in figures and not our own name: it may be another page's trick."""
    try:
        host = URL(f"http://{request.host}").host or ""
    except ValueError:
        host = ""
    if host not in ("localhost", listen):
        try:
            ipaddress.ip_address(host)
        except ValueError:
            raise web.HTTPForbidden(text="this host name is not ours; use the address that lobewatch printed") from None


def _check_origin(request: web.Request) -> None:
    """Refuse what comes from another page; what alters something or opens a feed must come from our own."""
    origin = request.headers.get("Origin")
    must = request.method != "GET" or "Upgrade" in request.headers
    if origin != f"http://{request.host}" and (must or origin is not None):
        raise web.HTTPForbidden(text="this request does not come from lobewatch's own page")


def _check_token(request: web.Request, tokens: Tokens, alters: bool) -> None:
    """Refuse without a token in the header Authorization, or for a WebSocket, which has none, among its protocols."""
    given = [request.headers.get("Authorization", "").removeprefix("Bearer ")]
    protocols = request.headers.get("Sec-WebSocket-Protocol", "").split(",")
    given += [name.strip().removeprefix("token.") for name in protocols]
    request[MAY_ALTER] = _is_among(given, tokens.full)
    if not request[MAY_ALTER] and not _is_among(given, tokens.watch):
        raise web.HTTPUnauthorized(text="open the whole address that lobewatch printed, with its token")
    if alters and not request[MAY_ALTER]:
        raise web.HTTPForbidden(text="this address is only to watch; open the other one that lobewatch printed")


def _is_among(given: list[str], token: str) -> bool:
    return any(hmac.compare_digest(word.encode("utf-8", "surrogateescape"), token.encode()) for word in given)
