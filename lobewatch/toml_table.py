"""What all tables of machine.toml share."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]


class Table(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of machine.toml: unknown keys are refused."""
