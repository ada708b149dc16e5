"""Lines of a text with their numbers, for messages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class NumberedLines:
    """Some lines of a file."""

    texts: Sequence[str]
    """Lines without their ends."""
    numbers: Sequence[int]
    """Number of each line, from 1 on."""

    def __getitem__(self, part: slice) -> NumberedLines:
        """Some of them."""
        return NumberedLines(self.texts[part], self.numbers[part])


def numbered_lines(text: str, skip: int) -> tuple[NumberedLines, list[str]]:
    """Those behind the first `skip` that are not empty, and what stands behind # in others."""
    texts = text.splitlines()[skip:]
    if "#" not in text and all(map(str.strip, texts)):
        return NumberedLines(texts, range(skip + 1, skip + len(texts) + 1)), []
    numbered = [(line, number) for number, line in enumerate(texts, skip + 1) if line.strip()]
    comments = [line.strip()[1:] for line, _ in numbered if line.lstrip().startswith("#")]
    numbered = [entry for entry in numbered if not entry[0].lstrip().startswith("#")]
    return NumberedLines([line for line, _ in numbered], [number for _, number in numbered]), comments
