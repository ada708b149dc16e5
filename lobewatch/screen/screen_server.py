"""The screen of one tap test, and that of one cut that is listened to."""

from __future__ import annotations

from lobewatch.screen.feed import Messages
from lobewatch.screen.messages import curves_message, cut_message
from lobewatch.screen.routes import WatchedTest, add_feed, add_pages, add_session
from lobewatch.screen.web_thread import WebThread
from lobewatch.tap.listening.cut_state import CutState
from lobewatch.tap.publisher import Pictures


class ScreenServer(WebThread):
    """Serves the screen of a tap test from __enter__ to __exit__, in a thread of its own.

    The session is only asked for its newest state, at most 20 times a second and page: it never waits for a screen.
    Whoever has `url` may watch, undo and stop, whoever has `watch_url` only watch; without a token nothing can be seen.
    """

    def __init__(
        self,
        session: WatchedTest,
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
    """Serves the screen of a cut that is listened to, likewise: nothing of it can be altered from a page."""

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
        add_feed(self.application, "/", lambda _: pictures, Messages(cut_message, curves_message))
