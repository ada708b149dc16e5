"""Routes that servers share: pages, the feed of what is watched, undo, stop and what comes next."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from importlib import resources
from typing import Protocol

import msgspec
from aiohttp import web

from acquisition import check_name
from lobewatch.screen.feed import Messages, PictureSource, State, feed
from lobewatch.screen.guard import MAY_ALTER, OPEN
from lobewatch.screen.messages import plots_message, state_message
from lobewatch.show.terminal.printer import RunningTest
from lobewatch.tap.state import TapState

TYPES = {"css": "text/css", "html": "text/html", "js": "text/javascript", "svg": "image/svg+xml"}
"""Content types of the files of pages, by the ending of their names."""


class WatchedTest(RunningTest, PictureSource[TapState], Protocol):
    """A live tap test that pages follow."""


class ChoiceRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Body of the request that says what comes after a test."""

    key: str
    """Key of the choice."""
    tool: str = ""
    """Name of the next tool, where that is chosen."""


def add_pages(application: web.Application, pages: dict[str, str]) -> None:
    """Serve pages (path: file in static/) and, at /static/, all that they load.

    The files are held in memory: nothing of the disk can be asked for by name.
    """
    folder = resources.files("lobewatch.screen").joinpath("static")
    files = {file.name: file.read_bytes() for file in folder.iterdir() if file.name.rpartition(".")[2] in TYPES}

    async def static(request: web.Request) -> web.Response:
        name = request.match_info["name"]
        if name not in files:
            raise web.HTTPNotFound(text="there is no such file")
        return _answer(files, name)

    application.router.add_get("/static/{name}", static, name=f"{OPEN}static")
    for i, (path, name) in enumerate(pages.items()):

        async def page(_: web.Request, name: str = name) -> web.Response:
            return _answer(files, name)

        application.router.add_get(path, page, name=f"{OPEN}page{i}")


def add_feed(
    application: web.Application,
    prefix: str,
    find: Callable[[web.Request], PictureSource[State]],
    messages: Messages[State],
) -> None:
    """Serve what is only watched. `find` raises HTTPNotFound where there is nothing."""

    async def follow(request: web.Request) -> web.StreamResponse:
        find(request)
        return await feed(request, lambda: find(request), messages)

    async def access(request: web.Request) -> web.Response:
        find(request)
        return web.json_response({"may_alter": request[MAY_ALTER]})

    application.router.add_get(f"{prefix}feed", follow)
    application.router.add_get(f"{prefix}access", access)


def add_session(application: web.Application, prefix: str, find: Callable[[web.Request], WatchedTest]) -> None:
    """Serve the screen of a session: its feed, undo, stop and what comes next.

    `find` raises HTTPNotFound where there is none.
    """

    async def undo(request: web.Request) -> web.Response:
        await asyncio.to_thread(find(request).undo)
        return web.json_response({})

    async def stop(request: web.Request) -> web.Response:
        await asyncio.to_thread(find(request).stop)
        return web.json_response({})

    async def choose(request: web.Request) -> web.Response:
        try:
            choice = msgspec.json.decode(await request.read(), type=ChoiceRequest)
        except (msgspec.DecodeError, UnicodeDecodeError):
            raise web.HTTPBadRequest(text='the body must be like {"key": "y"}') from None
        check_name(choice.tool, "tool")
        find(request).choose(choice.key, choice.tool)
        return web.json_response({})

    add_feed(application, prefix, find, Messages(state_message, plots_message))
    application.router.add_post(f"{prefix}undo", undo)
    application.router.add_post(f"{prefix}stop", stop)
    application.router.add_post(f"{prefix}choose", choose)


def _answer(files: dict[str, bytes], name: str) -> web.Response:
    return web.Response(body=files[name], content_type=TYPES[name.rpartition(".")[2]], charset="utf-8")
