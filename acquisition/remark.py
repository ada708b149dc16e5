"""What a person should know beside a result: data for the program, words for people."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Remark:
    """One thing to know. Programs look at `code` and `about`; `text` and `cure` are for people and may be reworded.

    >>> remark = Remark("swept", "A", "the spindle sweeps 40 Hz", "tap it warm")
    >>> remark.finding, remark.code
    ('A: the spindle sweeps 40 Hz', 'swept')
    """

    code: str
    """Kind of remark: words in lower case joined by hyphens, listed in docs/remarks.md, never changed."""
    about: str
    """Thing it concerns: a program, a tap test, a mode ("1713 Hz"), a channel, a file; empty for the whole."""
    text: str
    """Finding, with figures and units, without a full stop."""
    cure: str = ""
    """Advice what to do about it; empty where nothing can be done or need be."""

    def __str__(self) -> str:
        """One sentence."""
        return self.finding + (f"; {self.cure}" if self.cure else "")

    @property
    def finding(self) -> str:
        """The same without the cure."""
        return ": ".join(filter(None, (self.about, self.text)))


def joined(remarks: Iterable[Remark]) -> list[Remark]:
    """Remarks that differ in nothing but what they are about as one, in the order of the first of each.

    >>> remarks = [Remark("small", program, "it is small") for program in ("A", "B")]
    >>> [(remark.code, remark.about) for remark in joined(remarks)]
    [('small', 'A, B')]
    """
    about: dict[Remark, list[str]] = {}
    for remark in remarks:
        about.setdefault(replace(remark, about=""), []).append(remark.about)
    return [replace(first, about=", ".join(dict.fromkeys(filter(None, names)))) for first, names in about.items()]
