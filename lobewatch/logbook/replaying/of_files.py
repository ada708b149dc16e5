"""What is said of many files: once of all of which it is the same."""

from __future__ import annotations

from collections.abc import Iterable

NAMED = 3
"""Files that are named of those of which the same is said; the others are counted."""


def of_files(said: Iterable[tuple[str, str]]) -> list[str]:
    """A line for each sentence, in the order of the first file of each; said: names of files, each with a sentence."""
    files: dict[str, list[str]] = {}
    for file, sentence in said:
        files.setdefault(sentence, []).append(file)
    return [f"{_names(names)}: {sentence}" for sentence, names in files.items()]


def _names(files: list[str]) -> str:
    more = len(files) - NAMED
    return ", ".join(files[:NAMED]) + (f" and {more} more" if more > 0 else "")
