"""Public names are made of the terms of docs/glossary.md and of a few ordinary words."""

from __future__ import annotations

import re
from collections import defaultdict
from importlib import import_module
from pathlib import Path

from rooms import PACKAGES, read_house

ROOT = Path(__file__).parents[2]
HOUSE = read_house(ROOT)
ORDINARY = frozenset(
    re.findall(
        r"\w+",
        """
        above across address advise after all answer any apply assess below build busy by capture change check
        classify clock codes collect combine command common compare comparison compute computer conversion convert
        correct count damaged data deviation direction edit equal evaluate explain fact figure file find first fold
        folder follow for free from full function good half has id identity index infer info input inspect is join
        kind largest library linearized link list load location lower machine make match max mean merge message
        method min missing mistake motion name nearby nearest new no open outcome output pair parse part pattern
        pick pieces place plan project projected properties published random range rank read record remove require
        rounded rules running same sanitize scanned search select setup share shift side skip split state step
        stopped store structure summarize summary support system table text theory thread through time to together
        type unknown verify widen with x
        """,
    )
)
"""Words that need no explanation."""


def public_names() -> set[str]:
    """Return every name in an `__all__` of the five packages."""
    packages = [name for name in HOUSE.rooms if hasattr(import_module(name), "__all__")]
    return {name for package in packages for name in import_module(package).__all__}


def glossary_words() -> set[str]:
    """Return the words of the first column of the glossary, in singular and plural."""
    text = (ROOT / "docs" / "glossary.md").read_text("utf-8")
    terms = " ".join(re.findall(r"^\| ([^|]+) \|", text, re.MULTILINE))
    return {word.lower() for word in re.findall(r"[A-Za-z]+|\d+", terms)}


def words(name: str) -> list[str]:
    """Split a name into its words, in lower case."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]


def test_each_word_of_a_public_name_is_a_term_or_ordinary() -> None:
    known = glossary_words() | ORDINARY
    known |= {f"{word}s" for word in known} | {re.sub("y$", "ies", word) for word in known}
    strange = defaultdict[str, list[str]](list)
    for name in sorted(public_names()):
        for word in words(name):
            if word not in known:
                strange[word].append(name)
    assert strange == {}


def test_ordinary_words_are_few() -> None:
    assert len(ORDINARY) <= 150
    assert ORDINARY & glossary_words() == set()


def test_a_constant_name_is_used_in_at_most_two_modules() -> None:
    where = defaultdict[str, set[str]](set)
    for module, tree in HOUSE.trees.items():
        for name in HOUSE.constants(tree):
            where[name].add(module)
    assert {name: modules for name, modules in where.items() if len(modules) > 2} == {}
    assert set(PACKAGES) == {module.partition(".")[0] for module in HOUSE.trees}
