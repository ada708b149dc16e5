"""The screen of one tap test."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from aiohttp import web

from lobewatch.screen.feed import feed
from lobewatch.screen.guard import MAY_ALTER
from lobewatch.screen.pages import add_pages
from lobewatch.screen.web_thread import WebThread
from lobewatch.show.printer import Watched


class ScreenServer(WebThread):
    """Serves the screen of a tap test from __enter__ to __exit__, in a thread of its own.

    The session is only asked for its newest state, at most 20 times a second and page: it never waits for a screen.
    Whoever has `url` may watch, undo and stop, whoever has `watch_url` only watch; without a token nothing can be seen.
    """

    def __init__(
        self,
        session: Watched,
        *,
        listen: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        watch_token: str | None = None,
    ) -> None:
        """Port 0: any free one. Token None: a new one. ValueError for a token that does not fit into an address."""
        super().__init__(listen, port, token, watch_token)
        add_pages(self.application, {"/": "screen.html"})
        add_session(self.application, "/", lambda _: session)


def add_session(application: web.Application, prefix: str, find: Callable[[web.Request], Watched]) -> None:
    """Routes of the screen of a session: its feed, undo and stop. `find` raises HTTPNotFound where there is none."""

    async def follow(request: web.Request) -> web.StreamResponse:
        find(request)
        return await feed(request, lambda: find(request).state)

    async def undo(request: web.Request) -> web.Response:
        await asyncio.to_thread(find(request).undo)
        return web.json_response({})

    async def stop(request: web.Request) -> web.Response:
        await asyncio.to_thread(find(request).stop)
        return web.json_response({})

    async def access(request: web.Request) -> web.Response:
        find(request)
        return web.json_response({"may_alter": request[MAY_ALTER]})

    application.router.add_get(f"{prefix}feed", follow)
    application.router.add_get(f"{prefix}access", access)
    application.router.add_post(f"{prefix}undo", undo)
    application.router.add_post(f"{prefix}stop", stop)
