"""What is known of a recording and from where, what is missing, and what is wrong: collected, said together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Origin = Literal["file", "option", "default"]


@dataclass(frozen=True)
class Fact:
    """Something known of a recording."""

    name: str
    """Name of the fact: "sample rate", "unit", ..."""
    value: str
    """Value, as text for people."""
    origin: Origin
    """Origin: the file, an option, or nobody ("default")."""


@dataclass
class Ledger:
    """Filled while a file is understood."""

    facts: list[Fact] = field(default_factory=list)
    """Facts that are known."""
    missing: list[str] = field(default_factory=list)
    """Facts that the file does not say, each with the option that says it."""
    faults: list[str] = field(default_factory=list)
    """Faults that stand in the way."""

    def know(self, name: str, value: str, origin: Origin = "file") -> None:
        """A fact."""
        self.facts.append(Fact(name, value, origin))

    def add(self, other: Ledger) -> None:
        """All that another one holds."""
        self.facts += other.facts
        self.missing += other.missing
        self.faults += other.faults

    def ask(self, fact: str, option: str) -> None:
        """Something is missing."""
        self.missing.append(f"{fact} ({option})")

    def contradict(self, option: str, given: object, in_file: object) -> None:
        """An option says other than the file."""
        self.faults.append(f"{option} {given}: the file says {in_file}; leave the option out")

    @property
    def is_clean(self) -> bool:
        """Whether nothing is missing or wrong."""
        return not self.missing and not self.faults

    def complaint(self) -> str:
        """All that is missing and wrong; empty where nothing is."""
        sentences = ["; ".join(self.faults)] if self.faults else []
        sentences += [f"it does not say: {', '.join(self.missing)}"] if self.missing else []
        return "; ".join(sentences)
