"""What an export has done."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple


class ExportOutcome(NamedTuple):
    """The tap tests that were exported, and what there is to say besides."""

    tap_tests: int
    """Number of tap tests of the machines that could be read."""
    fields: Mapping[str, Any]
    """Fields for other programs: the place under its name first."""
    sentences: Sequence[str] = ()
    """Sentences for people."""
