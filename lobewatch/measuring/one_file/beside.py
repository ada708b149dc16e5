"""Other measurements of the same structure, looked at beside one file for the modes that they have too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition import Description
from lobewatch.measuring.one_file.file_modes import FileModes
from modal import found_again


def places_beside(beside: Sequence[str], file: Path, description: Description) -> list[tuple[Path, Description]]:
    """Files, and what they do not say: each of beside is a file, or the number of another response of this one."""
    return [
        (file, replace(description, response=int(text))) if text.isdecimal() else (Path(text), description)
        for text in beside
    ]


def found_beside(file_modes: FileModes, beside: Sequence[str], others: Sequence[FileModes]) -> FileModes:
    """The modes of a file, each with how many of the others have it too; beside: what each of these was named by.

    ValueError where two are the same measurement.
    """
    for place, (text, other) in enumerate(zip(beside, others, strict=True)):
        if any(_is_same(other, one) for one in (file_modes, *others[:place])):
            raise ValueError(f"--beside {text}: the same numbers are looked at already; name another measurement")
    found = [other.fitted for other in others]
    as_recorded, fitted = (tuple(found_again(modes, found)) for modes in (file_modes.as_recorded, file_modes.fitted))
    return replace(file_modes, as_recorded=as_recorded, fitted=fitted)


def _is_same(one: FileModes, other: FileModes) -> bool:
    return np.array_equal(one.extraction.frf.receptance, other.extraction.frf.receptance)
