"""A value altered in machine.toml leaves all else as it was written."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition import DataError
from lobewatch.machine.settings.toml import (
    TablePath,
    TomlValue,
    edit_toml,
    find_key_conflicts,
    read_toml_text,
    write_toml_text,
)

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


LINE_ENDS = st.sampled_from(["\n", "\r\n", "\r"])


@settings(deadline=None, max_examples=40)
@given(st.lists(LINE_ENDS, min_size=3, max_size=3), st.booleans(), st.sampled_from([0o600, 0o664]), st.booleans())
def test_an_edited_file_keeps_its_bytes_mode_and_link(
    tmp_path_factory: pytest.TempPathFactory, ends: list[str], marked: bool, mode: int, linked: bool
) -> None:
    folder = tmp_path_factory.mktemp("m")
    toml = target = folder / "machine.toml"
    if linked:
        target = folder / "real.toml"
        toml.symlink_to(target.name)
    first, second, third = ends
    mark = "\ufeff" if marked else ""
    target.write_bytes(f"{mark}[a]  # ü{first}x = 1  # why{second}# mid{third}# end".encode())
    target.chmod(mode)
    write_toml_text(toml, edit_toml(read_toml_text(toml), TablePath("a"), {"x": 2, "y": 3}))
    assert target.read_bytes() == f"{mark}[a]  # ü{first}x = 2  # why{second}y = 3{first}# mid{third}# end".encode()
    assert toml.is_symlink() == linked
    assert target.stat().st_mode & 0o777 == mode


@pytest.mark.parametrize(
    ("old", "text", "new"),
    [
        (b"", "a\nb", b"a\nb"),
        (b"a", "a\nb", b"a\nb"),
        (b"a\r\nb\r\nc", "a\nb", b"a\r\nb"),
        (b"a\n\r\nb", "a\nb", b"a\nb"),
        (b"a\r\nx\ny\nb\r\nc\n", "a\nz\nb\nc\n", b"a\r\nz\nb\r\nc\n"),
    ],
)
def test_a_text_that_grows_or_shrinks_keeps_the_ends_of_its_lines(
    old: bytes, text: str, new: bytes, tmp_path: Path
) -> None:
    toml = tmp_path / "machine.toml"
    toml.write_bytes(old)
    write_toml_text(toml, text)
    assert toml.read_bytes() == new


@pytest.mark.parametrize(
    ("seen", "present", "wanted", "keys"),
    [
        ("x = 1", "x = 1", "x = 2", []),
        ("x = 1", "x = 3", "x = 3", []),
        ("x = 1", "x = 3\ny = 1", "x = 3\ny = 2", ["y"]),
        ("x = 1", "x = 3", "x = 2", ["x"]),
        ("x = 1", "x = 3", "", ["x"]),
        ("x = 1", "", "x = 2", ["x"]),
        ("[a.b]\nx = 1", "[a.b]\nx = 3", "[a.b]\nx = 2", ["a b x"]),
        ("[[p]]\nname = 'A'\nx = 1", "[[p]]\nname = 'B'\nx = 1", "[[p]]\nname = 'B'\nx = 2", ["p 'B' x"]),
        ("[[p]]\nname = 'A'", "[[p]]\nname = 'B'\n[[p]]\nname = 'A'", "[[p]]\nname = 'B'\n[[p]]\nname = 'C'", []),
        ("[[p]]\nx=1\n[[p]]\nx=2", "[[p]]\nx=1\n[[p]]\nx=3", "[[p]]\nx=4\n[[p]]\nx=5", ["p '' again x"]),
    ],
)
def test_only_a_key_that_two_have_changed_is_in_conflict(seen: str, present: str, wanted: str, keys: list[str]) -> None:
    assert [conflict.key for conflict in find_key_conflicts(seen, present, wanted)] == keys
