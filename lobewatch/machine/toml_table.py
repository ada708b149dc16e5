"""What all tables of machine.toml share."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

Positive = Annotated[float, Meta(gt=0, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0, le=1e12)]
PositiveOrInfinite = Annotated[float, Meta(gt=0)]
"""Where infinity means "rigid" or "no limit"."""


class Table(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of machine.toml: unknown keys are refused."""
