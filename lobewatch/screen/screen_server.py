"""The screen of one tap test, and that of one cut that is listened to."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from aiohttp import web

from lobewatch.screen.cut_messages import cut_message
from lobewatch.screen.feed import Messages, State, feed
from lobewatch.screen.guard import MAY_ALTER
from lobewatch.screen.messages import curves_message, plots_message, state_message
from lobewatch.screen.pages import add_pages
from lobewatch.screen.web_thread import WebThread
from lobewatch.show.terminal.printer import Watched
from lobewatch.tap.listening.cut_state import CutState
from lobewatch.tap.publisher import Pictures


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


class CutScreenServer(WebThread):
    """The same for a cut that is listened to: nothing of it can be altered from a page."""

    def __init__(
        self,
        pictures: Pictures[CutState],
        *,
        listen: str = "127.0.0.1",
        token: str | None = None,
        watch_token: str | None = None,
    ) -> None:
        """At any free port. Token None: a new one. ValueError for a token that does not fit into an address."""
        super().__init__(listen, 0, token, watch_token)
        add_pages(self.application, {"/": "listen.html"})
        add_feed(self.application, "/", lambda _: pictures.state, Messages(cut_message, curves_message))


def add_feed(
    application: web.Application, prefix: str, newest: Callable[[web.Request], State], told: Messages[State]
) -> None:
    """Routes of what is only watched. `newest` raises HTTPNotFound where there is nothing."""

    async def follow(request: web.Request) -> web.StreamResponse:
        newest(request)
        return await feed(request, lambda: newest(request), told)

    async def access(request: web.Request) -> web.Response:
        newest(request)
        return web.json_response({"may_alter": request[MAY_ALTER]})

    application.router.add_get(f"{prefix}feed", follow)
    application.router.add_get(f"{prefix}access", access)


def add_session(application: web.Application, prefix: str, find: Callable[[web.Request], Watched]) -> None:
    """Routes of the screen of a session: its feed, undo and stop. `find` raises HTTPNotFound where there is none."""

    async def undo(request: web.Request) -> web.Response:
        await asyncio.to_thread(find(request).undo)
        return web.json_response({})

    async def stop(request: web.Request) -> web.Response:
        await asyncio.to_thread(find(request).stop)
        return web.json_response({})

    add_feed(application, prefix, lambda request: find(request).state, Messages(state_message, plots_message))
    application.router.add_post(f"{prefix}undo", undo)
    application.router.add_post(f"{prefix}stop", stop)
