"""Texts of the parts of a cut."""

from collections.abc import Sequence

from lobewatch.machine.journal.entries import PartVerdict


def part_text(part: PartVerdict) -> str:
    """Return the verdict on a part of a cut with its times, such as "chatter at 1760 Hz from 1.6 to 4.6 s"."""
    at = "" if part.hz is None else f" at {part.hz:.0f} Hz"
    word = "period-two chatter" if part.verdict == "flip" else part.verdict
    return f"{word}{at} from {part.from_s:.1f} to {part.to_s:.1f} s"


def parts_texts(parts: Sequence[PartVerdict]) -> list[str]:
    """Return the verdicts on the parts of a cut in one text, empty if they are one part."""
    return [", ".join(map(part_text, parts))] if len(parts) > 1 else []
