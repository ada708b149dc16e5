"""Modes of tap tests that a person chose, as lines of the journal; the newest line on one of them counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from typing import Any

import msgspec

from modal import ModeEdits


def mode_choice(tap_id: str, edits: ModeEdits, now: datetime) -> dict[str, Any]:
    """Line that says it; edits that say nothing take back what was said before."""
    return {"kind": "modes", "tap": tap_id, **asdict(edits), "time": now.isoformat()}


def mode_choices(entries: Sequence[Mapping[str, Any]]) -> dict[str, ModeEdits]:
    """What was said of the modes of tap tests, by identity."""
    return {line["tap"]: msgspec.convert(line, ModeEdits) for line in entries if line["kind"] == "modes"}
