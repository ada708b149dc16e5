"""Test printed results: no text controls the terminal, and JSON is exact."""

from __future__ import annotations

import io
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from rich.text import Text

from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.show.terminal.output import SafeConsole, emit, make_printable, new_table

HARM = "\x1b]0;owned\x07\x1b[2J\x9b31m\r\x00\x7f\u2028"


def printed(*texts: object, **options: object) -> str:
    to = io.StringIO()
    SafeConsole(file=to, **options).print(*texts)  # type: ignore[arg-type]
    return to.getvalue()


def cells(*row: str) -> str:
    rows = new_table("<name", "value")
    rows.add_row(*row)
    return printed(rows, width=120)


@pytest.mark.parametrize("text", [HARM, Text(HARM)])
def test_texts_cannot_steer_the_terminal(text: object) -> None:
    output = printed(text)
    assert output.isprintable() or output.rstrip("\n").isprintable()
    assert "\ufffd" in output


def test_the_console_itself_still_can() -> None:
    output = printed("[bold]a[/]", force_terminal=True, color_system="standard")
    assert "\x1b[1ma" in output
    to = io.StringIO()
    console = SafeConsole(file=to, force_terminal=True)
    console.bell()
    console.show_cursor(False)
    assert to.getvalue() == "\x07\x1b[?25l"


def test_lines_of_a_text_stay_and_rows_of_a_table_are_never_broken() -> None:
    assert printed("one\ntwo") == "one\ntwo\n"
    output = cells("one\ntwo\tthree", "1")
    assert "one\ufffdtwo\ufffdthree" in output
    assert output.count("\n") == 2


@given(st.text())
def test_json_is_exact_and_harmless(text: str) -> None:
    to = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lobewatch.show.terminal.output.results", SafeConsole(file=to, width=120))
        emit({text: [text, 1.5, float("nan")]}, True)
    told = with_option_names(text)
    assert json.loads(to.getvalue()) == {told: [told, 1.5, None]}
    assert make_printable(to.getvalue()) == to.getvalue()


def test_json_on_a_terminal_is_coloured_as_rich_does_it() -> None:
    ours, theirs = io.StringIO(), io.StringIO()
    payload = {"a": [1, None, True, "ä"], "b": {"c": "x"}}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lobewatch.show.terminal.output.results", SafeConsole(file=ours, force_terminal=True, width=80))
        emit(payload, True)
    Console(file=theirs, force_terminal=True, width=80).print_json(json.dumps(payload))
    assert ours.getvalue() == theirs.getvalue()


def test_fields_become_options_and_file_names_stay() -> None:
    shown = with_option_names("Conditions.csv, my-Window.txt: give Description.force_unit or Workers.jobs")
    assert shown == "Conditions.csv, my-Window.txt: give --force-unit or --jobs"
