"""The address of a screen: its options, and how it is told."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import webbrowser
from collections.abc import Iterator
from typing import Annotated, Protocol

import typer

from lobewatch.show.terminal.output import notes, results

Listen = Annotated[str, typer.Option(help="Address of this computer at which the screen answers; 0.0.0.0: at all.")]
Token = Annotated[
    str | None, typer.Option(help="What a browser must know to see and alter anything; a new one where not given.")
]
WatchToken = Annotated[
    str | None, typer.Option(help="What a browser must know only to see anything; a new one where not given.")
]


class Server(contextlib.AbstractContextManager["Server"], Protocol):
    """Answers while its context lasts."""

    @property
    def url(self) -> str:
        """For those who may alter something."""
        ...

    @property
    def watch_url(self) -> str:
        """For those who may only watch."""
        ...


@contextlib.contextmanager
def serving(server: Server) -> Iterator[None]:
    """Let a screen answer, and print its address."""
    with server:
        show_address(server.url, server.watch_url)
        yield


def show_address(url: str, watch_url: str, as_json: bool = False) -> None:
    """Print the address and that for those who may only watch; open the first where somebody sits at a screen."""
    if as_json:
        results.print(json.dumps({"url": url, "watch_url": watch_url}), markup=False)
        results.file.flush()
    else:
        notes.print(f"screen: {url}", markup=False)
        notes.print(f"only to watch: {watch_url}", markup=False)
    display = sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.stdout.isatty() and display:
        webbrowser.open(url)
