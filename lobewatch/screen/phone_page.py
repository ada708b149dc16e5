"""Serve the page that takes a recording of a cut made on a phone."""

import asyncio
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Unpack

from aiohttp import web

from lobewatch.logbook import Logbook
from lobewatch.machine import MachineFolder
from lobewatch.notify.publish_status import publish_status
from lobewatch.screen.uploaded_recording import MAX_UPLOAD_BYTES, evaluate_upload, parse_uploaded_cut, refuse
from lobewatch.screen.web_server import ServerOptions, WebServerThread, add_pages

MAX_UPLOAD_SECONDS = 120.0
"""Longest time of an upload (s); chosen, 50 MB at 3.3 Mbit/s."""
UPLOAD_CHUNK_BYTES = 1 << 16
"""Size of the parts that an upload is read in (bytes); chosen."""


def add_recording_upload(
    application: web.Application, prefix: str, folders: Callable[[], Mapping[str, Path]] = dict
) -> None:
    """Serve the evaluation of uploaded recordings at `prefix`recording, one at a time.

    folders: returns the machine folders by name in whose journals a cut can be kept, listed at `prefix`machines.
    """
    busy = asyncio.Lock()
    find_folder = _add_machine_list(application, prefix, folders)

    async def evaluate(request: web.Request) -> web.Response:
        cut = parse_uploaded_cut(request.query)
        kept = [find_folder(cut.machine)] if cut.machine else []
        if busy.locked():
            text = "lobewatch evaluates another recording. Send this recording again in a minute."
            return web.json_response(refuse("busy", text), status=409)
        async with busy:
            try:
                content = await _read_recording(request)
            except TimeoutError:
                text = f"the upload took more than {MAX_UPLOAD_SECONDS:g} s. Send a shorter recording."
                return web.json_response(refuse("too-slow", text), status=408)
            if content is None:
                text = f"the recording is larger than {MAX_UPLOAD_BYTES / 1e6:g} MB. Send a shorter recording."
                return web.json_response(refuse("too-large", text), status=413)
            answer = await asyncio.to_thread(evaluate_upload, content, cut, *kept)
        if "saved" in answer:
            await asyncio.to_thread(lambda: publish_status(Logbook.open(kept[0])))
        return web.json_response(answer, status=422 if "error" in answer else 200)

    application.router.add_post(f"{prefix}recording", evaluate)


def _add_machine_list(
    application: web.Application, prefix: str, folders: Callable[[], Mapping[str, Path]]
) -> Callable[[str], Path]:
    """Serve the list of machines and their programs, and return a function that finds the folder of a machine."""

    def find_folder(name: str) -> Path:
        folder = folders().get(name)
        if folder is None:
            raise web.HTTPNotFound(text="this machine does not exist")
        return folder

    async def list_machines(_: web.Request) -> web.Response:
        return web.json_response({"machines": sorted(folders())})

    async def list_programs(request: web.Request) -> web.Response:
        folder = find_folder(request.match_info["machine"])
        return web.json_response(await asyncio.to_thread(_describe_machine, folder))

    application.router.add_get(f"{prefix}machines", list_machines)
    application.router.add_get(f"{prefix}machines/{{machine}}", list_programs)
    return find_folder


def _describe_machine(folder: Path) -> dict[str, Any]:
    """Return the units of machine.toml, and its cuts with flutes, and with speed and depth if they have some."""
    machine, keys = MachineFolder(folder).machine, ("teeth", "speed_rpm", "depth_mm")
    cuts = machine.cut_tables.items()
    listed = [{"name": name} | {key: _known(getattr(cut, key, None)) for key in keys} for name, cut in cuts]
    return {"units": machine.machine.units, "programs": listed}


def _known(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


async def _read_recording(request: web.Request) -> bytearray | None:
    """Read the body of a request; None if it is too large, TimeoutError if it takes too long."""
    content = bytearray()
    if (request.content_length or 0) > MAX_UPLOAD_BYTES:
        return None
    async with asyncio.timeout(MAX_UPLOAD_SECONDS):
        async for chunk in request.content.iter_chunked(UPLOAD_CHUNK_BYTES):
            content += chunk
            if len(content) > MAX_UPLOAD_BYTES:
                return None
    return content


class RecordingServer(WebServerThread):
    """Server of the page that takes recordings of cuts, in a thread of its own while its context lasts."""

    def __init__(self, **options: Unpack[ServerOptions]) -> None:
        """Prepare the server.

        Parameters
        ----------
        options
            Address, port and tokens as in `ServerOptions`. ValueError for an invalid token.
        """
        super().__init__(**options)
        add_pages(self.application, {"/": "phone.html"})
        add_recording_upload(self.application, "/")
