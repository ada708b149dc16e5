"""One question of `lobewatch init`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lobewatch.machine.set_up.draft import Draft


def _never(_: Draft) -> str:
    return ""


@dataclass(frozen=True)
class SetUpQuestion:
    """Something that machine.toml needs and only a person knows."""

    name: str
    """Name, as in --edit NAME, and of the option that answers it."""
    words: str
    """Words of the question."""
    example: str
    """Answer that somebody else might give."""
    current: Callable[[Draft], str]
    """Function that gives the answer that stands there already, "-" where it was left open, "" where there is none."""
    answer: Callable[[Draft, str], Draft]
    """Function that takes an answer; ValueError for one that is none."""
    already: Callable[[Draft], str] = _never
    """Function that gives the reason why nothing is asked; empty where it is."""
