"""The files of the pages, from memory: nothing of the disk can be asked for by name."""

from __future__ import annotations

from importlib import resources

from aiohttp import web

from lobewatch.screen.guard import OPEN

TYPES = {"css": "text/css", "html": "text/html", "js": "text/javascript", "svg": "image/svg+xml"}


def add_pages(application: web.Application, pages: dict[str, str]) -> None:
    """Serve pages (path: file in static/) and, at /static/, all that they load."""
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


def _answer(files: dict[str, bytes], name: str) -> web.Response:
    return web.Response(body=files[name], content_type=TYPES[name.rpartition(".")[2]], charset="utf-8")
