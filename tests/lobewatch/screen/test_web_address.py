"""Address of the web server of the screen, and the tokens in it."""

from __future__ import annotations

import socket
from typing import Any

import pytest

from acquisition import DeviceError
from lobewatch.screen import ScreenServer
from lobewatch.screen.web_server import WebServerThread
from tests.lobewatch.screen.test_web_server import ask

Session = Any
"""ScriptedSession of conftest.py."""


def test_every_token_is_another() -> None:
    servers = [WebServerThread("127.0.0.1", 0, None) for _ in range(20)]
    tokens = {token for server in servers for token in (server.token, server.watch_token)}
    assert len(tokens) == 40
    assert min(map(len, tokens)) >= 32


@pytest.mark.parametrize("token", ["", "short", "has a space in it", "ä" * 20, "x#y" * 9])
@pytest.mark.quick
def test_a_token_that_does_not_fit_into_an_address_is_rejected(session: Session, token: str) -> None:
    with pytest.raises(ValueError, match="12 to 200 characters"):
        ScreenServer(session, token=token)


def test_a_port_in_use_is_reported(session: Session) -> None:
    with ScreenServer(session) as server:
        port = int(server.origin.rpartition(":")[2])
        with (
            pytest.raises(DeviceError, match=rf"127\.0\.0\.1.*{port}"),
            ScreenServer(session, port=port),
        ):
            pass


@pytest.mark.parametrize("listen", ["a..b", "x" * 70, "no such name"])
def test_an_address_that_cannot_be_is_reported(session: Session, listen: str) -> None:
    with pytest.raises(DeviceError, match=f"{listen}.* 0"), ScreenServer(session, listen=listen):
        pass


def test_no_address_is_not_every_address(session: Session) -> None:
    with pytest.raises(ValueError, match=r"127\.0\.0\.1"):
        ScreenServer(session, listen="")


@pytest.mark.parametrize("listen", ["0.0.0.0", "::", "LocalHost"])
def test_the_address_reported_is_one_that_answers(session: Session, listen: str) -> None:
    if listen == "::" and not socket.has_dualstack_ipv6():
        pytest.skip("no IPv6 here")
    with ScreenServer(session, listen=listen) as server:
        assert ask(server, "GET", "/access")[0] == 200
