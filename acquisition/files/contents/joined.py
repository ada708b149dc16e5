"""Two files of one hit: the response in one, the force in the other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from acquisition.files.contents.contents import Contents, Signal


def joined(response: Contents, force: Contents, force_file: Path) -> Contents:
    """The signals of both, those of the force behind; where both have a name it says which file it is of."""
    names = {signal.name for signal in response.signals}
    added = [_renamed(signal, names, force_file.name) for signal in force.signals]
    return replace(response, signals=(*response.signals, *added))


def _renamed(signal: Signal, names: set[str], file: str) -> Signal:
    return replace(signal, name=f"{signal.name} of {file}") if signal.name in names else signal
