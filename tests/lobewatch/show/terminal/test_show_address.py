"""Test the address of a page: always printed, opened only on a desktop."""

from __future__ import annotations

import sys

import pytest

from lobewatch.show.terminal.output import show_address

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("is_terminal", [True, False])
@pytest.mark.parametrize("display", [":0", ""])
def test_a_page_is_opened_only_at_a_terminal_with_a_display(
    is_terminal: bool, display: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = list[str]()
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: is_terminal)
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    show_address("http://one", "http://other")
    assert opened == (["http://one"] if is_terminal and display else [])
