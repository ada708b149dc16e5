"""Whether a journal is that of another machine: a folder that was mixed up."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path

from acquisition import machine_of, named_in_id


def foreign(folder: Path, lines: Sequence[bytes]) -> str:
    """What is wrong with a journal whose tap tests are all missing and of another machine; else empty.

    lines: of the journal. Looks no farther than the first tap file that is there.
    """
    listed = (entry["id"] for entry in map(json.loads, lines) if entry["kind"] == "tap")
    missing = []
    for tap_id in listed:
        if (folder / "taps" / f"{tap_id}.h5").exists():
            return ""
        missing.append(tap_id)
    own = _own_name(folder) if missing else ""
    files = [path.stem for path in (folder / "taps").glob("*.h5")] if own else []
    mine = [tap_id for tap_id in files if machine_of(tap_id) == named_in_id(own)]
    others = _names(missing)
    if not mine or named_in_id(own) in others:
        return ""
    lists = f"lists {len(missing)} tap test{'s' if len(missing) > 1 else ''} of {', '.join(others)}, none of them here"
    return f"is that of another machine: it {lists}, while taps/ holds {len(mine)} of {own}"


def _own_name(folder: Path) -> str:
    try:
        return str(tomllib.loads((folder / "machine.toml").read_text("utf-8"))["machine"]["name"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _names(tap_ids: Iterable[str]) -> list[str]:
    return sorted({machine_of(tap_id) for tap_id in tap_ids})
