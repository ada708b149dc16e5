"""A value altered in machine.toml leaves all else as it was written."""

from __future__ import annotations

import tomllib
from importlib import resources

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition import DataError
from lobewatch.machine.settings.toml import TablePath, TomlValue, edit_toml

NEW, EXAMPLE = (
    resources.files("sim_data").joinpath(name).read_text("utf-8")
    for name in ("new_machine.toml", "surrogate_machine.toml")
)
TEXTS = st.text(st.characters(exclude_categories=["Cs", "Cc"]))
VALUES = st.one_of(st.booleans(), st.integers(-(2**53), 2**53), st.floats(-1e12, 1e12), TEXTS)


@settings(deadline=None)
@given(st.sampled_from([NEW, EXAMPLE]), st.sampled_from(["tap", "daq", "speed", "drive", "limits"]), VALUES)
def test_any_value_comes_back_and_other_lines_stay(text: str, table: str, value: TomlValue) -> None:
    edited = edit_toml(text, TablePath(table), {"state": value})
    assert tomllib.loads(edited)[table]["state"] == value
    gone = [line for line in text.splitlines() if line not in edited.splitlines()]
    assert all(line.startswith("# state = ") for line in gone)
    again = edit_toml(edited, TablePath(table), {"state": None})
    assert tomllib.loads(again).get(table, {}) == tomllib.loads(text).get(table, {})


@pytest.mark.parametrize(
    ("text", "key", "value", "edited"),
    [
        ("[a]\nx = 1  # why\n", "x", 2, "[a]\nx = 2  # why\n"),
        ("[a]\n# x = 1\ny = 3\n", "x", 2, "[a]\nx = 2\ny = 3\n"),
        ("[a]\n# x = 1\nx = 3\n", "x", 2, "[a]\n# x = 1\nx = 2\n"),
        ('[a]\nx = "#"  # it\'s "so"\n', "x", "", '[a]\nx = ""   # it\'s "so"\n'),
        ("[a]\ny = 1\n\n[b]\nx = 1\n", "x", 2.5, "[a]\ny = 1\nx = 2.5\n\n[b]\nx = 1\n"),
        ("# [a]\n# x = 1\n", "x", 2, "[a]\nx = 2\n"),
        ("[b]\nx = 1\n", "x", "ü", '[b]\nx = 1\n\n[a]\nx = "ü"\n'),
        ("[a]\nx = 1\n", "x", None, "[a]\n# x = 1\n"),
    ],
)
def test_a_line_is_edited_where_a_person_would(text: str, key: str, value: TomlValue, edited: str) -> None:
    assert edit_toml(text, TablePath("a"), {key: value}) == edited


def test_tables_of_a_list_are_distinguished_and_added() -> None:
    text = '[[p]]\nname = "A"\n\n[[p]]\nname = "B"\n\n# about c\n[c]\n'
    assert '"A"\n\n[[p]]\nname = "Z"' in edit_toml(text, TablePath("p", 1), {"name": "Z"})
    added = edit_toml(text, TablePath("p", 2), {"name": "C"})
    assert added == '[[p]]\nname = "A"\n\n[[p]]\nname = "B"\n\n[[p]]\nname = "C"\n\n# about c\n[c]\n'


@pytest.mark.parametrize("text", ["[a]\nx = [\n 1,\n]\n", "a = { x = 1 }\n", 'a.x = """\n1"""\n', "[ a ]\nx = 1\n"])
def test_what_only_a_person_can_edit_is_rejected(text: str) -> None:
    with pytest.raises(DataError, match=r"machine\.toml: \[a\]"):
        edit_toml(text, TablePath("a"), {"x": 2})
