"""A table of machine.toml, and the kinds of number in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from msgspec import Meta, Struct

from acquisition import check_name

Positive = Annotated[float, Meta(gt=0, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0, le=1e12)]
PositiveOrInfinite = Annotated[float, Meta(gt=0)]
"""Number that may be infinite, for "rigid" or "no limit"."""


class Table(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of machine.toml: unknown keys are refused."""


def check_texts(table: Mapping[str, Any], place: str = "") -> None:
    """ValueError with its place for the first text, in whatever table, with a control character in it."""
    for key, value in table.items():
        if isinstance(value, str):
            check_name(value, f"{place}{key}")
        elif isinstance(value, Mapping):
            check_texts(value, f"{place}{key}: ")
        elif isinstance(value, list):
            for i, inner in enumerate(value, 1):
                if isinstance(inner, Mapping):
                    check_texts(inner, f"{place}{key.removesuffix('s')} {i}: ")
