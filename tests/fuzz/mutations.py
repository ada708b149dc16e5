"""Inputs that are nearly right: real bytes with wrong pieces, and real objects with wrong values."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from typing import Any

from hypothesis import strategies as st

PIECES = (
    b"",
    b"\0",
    b"\n",
    b"\r\n",
    b'"',
    b"'''",
    b"=",
    b",",
    b"-1",
    b"0",
    b"1e999",
    b"-1e308",
    b"nan",
    b"inf",
    b"true",
    b"null",
    b"9" * 40,
    b"9" * 5000,
    b"[" * 3000,
    b'{"a":' * 3000,
    b"a." * 2000,
    b"\xff" * 8,
    b"\xef\xbb\xbf",
    b'"\\ud800"',
    b"\x1b[2J",
    b"../../x",
)
"""Bytes that broke other programs: limits of numbers, deep nesting, control characters, wrong encodings."""
VALUES: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    1e308,
    2**70,
    float("nan"),
    "",
    "\x1b[2J",
    "../x",
    "x" * 3000,
    "\ud800",
    [],
    [[]],
    {},
    {"a": []},
)
"""Values of JSON that a field does not expect."""
edits = st.lists(
    st.tuples(st.floats(0, 1), st.integers(0, 60), st.sampled_from(PIECES) | st.binary(max_size=6)), max_size=5
)


def edit_bytes(content: bytes, changes: Sequence[tuple[float, int, bytes]]) -> bytes:
    """Replace some bytes at each place (a share of the length) by a piece."""
    for place, length, piece in changes:
        at = int(place * len(content))
        content = content[:at] + piece + content[at + length :]
    return content


def edited(seeds: Sequence[bytes]) -> st.SearchStrategy[bytes]:
    """Return a strategy of seeds with wrong pieces."""
    return st.builds(edit_bytes, st.sampled_from(list(seeds)), edits)


def edited_object(seed: Any) -> st.SearchStrategy[Any]:
    """Return a strategy of a JSON object with wrong, missing or further values."""
    changes = st.lists(st.tuples(st.integers(0, 99), st.sampled_from((*VALUES, ...))), max_size=3)
    return st.builds(_edit_object, st.just(seed), changes)


def _edit_object(seed: Any, changes: Sequence[tuple[int, Any]]) -> Any:
    whole = copy.deepcopy(seed)
    for number, value in changes:
        places = list(_places(whole))
        if places:
            parent, key = places[number % len(places)]
            if value is ...:
                del parent[key]
            else:
                parent[key] = copy.deepcopy(value)
    return whole


def _places(node: Any) -> Iterator[tuple[Any, Any]]:
    """Yield each place of a value, as its parent and key, in an object and all objects in it."""
    keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
    for key in keys:
        yield node, key
        yield from _places(node[key])
