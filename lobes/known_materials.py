"""All cutting coefficients that come with this package, and how their names are looked up."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from lobes.coefficients import Coefficients
from lobes.listed_materials import listed_materials
from lobes.milling_tests import milling_tests


def cutting_coefficients() -> tuple[Coefficients, ...]:
    """All coefficients that are known: those measured by milling, then the materials listed by name.

    These have theirs from published specific cutting forces. Each names its source.
    """
    return (*milling_tests(), *listed_materials())


def folded_name(name: str) -> str:
    """A name of a material without what is forgiven: case and blanks.

    >>> folded_name("Al 7075-T6") == folded_name("AL7075-t6")
    True
    """
    return "".join(name.split()).casefold()


@cache
def materials_by_name() -> Mapping[str, Coefficients]:
    """The coefficients by each of their names, as `folded_name` writes them.

    >>> materials_by_name()[folded_name("AA 7075")].names
    ('EN AW-7075', '3.4365', 'AlZn5.5MgCu', 'AlZnMgCu1.5', 'AA 7075', 'UNS A97075')
    """
    known = ((name, one) for one in cutting_coefficients() for name in one.names)
    return MappingProxyType({folded_name(name): one for name, one in known})


def nearest_name(name: str, by_name: Mapping[str, Coefficients]) -> str:
    """The known name, as it is written, that is most like one that is not; by_name: materials by folded names.

    >>> nearest_name("AA 7057", materials_by_name())
    'AA 7075'
    """
    nearest = difflib.get_close_matches(folded_name(name), by_name, n=1, cutoff=0.0)[0]
    return next(known for known in by_name[nearest].names if folded_name(known) == nearest)


def find_materials(word: str) -> list[Coefficients]:
    """Those of a group of ISO 513 (one letter), else those that have the word in one of their names; "": all.

    Case and blanks do not count. Raises ValueError where there are none.

    >>> sorted({material.alloy for material in find_materials("7075")})
    ['Al 7075']
    >>> len(find_materials("N")) >= 10  # group N of ISO 513: all that is not ferrous
    True
    """
    folded, known = folded_name(word), cutting_coefficients()
    of_group = [one for one in known if folded and one.iso_group.casefold() == folded]
    matching = of_group or [one for one in known if any(folded in folded_name(name) for name in one.names)]
    if not matching:
        near = nearest_name(word, materials_by_name())
        raise ValueError(f"no material has {word!r} in a name; is {near!r} meant? Without a word all are listed")
    return matching
