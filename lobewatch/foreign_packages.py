"""Detect packages of other distributions that took the name or the folder of a package of lobewatch.

`pip install modal`, for example, writes its files into the folder `modal` of lobewatch.
"""

import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

OWN_PACKAGES = ("acquisition", "modal", "dsm", "lobes")
"""Packages next to lobewatch that another distribution may have, too."""
OWN_INIT_TEXT = b"lazy_loader.attach_stub(__name__, __file__)"
"""Text in the `__init__.py` of each of these packages."""
FOREIGN_PACKAGE_CURE = "Make a new environment and install lobewatch there, without other packages of these names"
"""Remedy for foreign packages, without a full stop."""


class ForeignPackageError(ImportError):
    """Raised at the import of a foreign package in place of one of lobewatch."""


class _ImportGuard:
    """Import hook that refuses foreign packages."""

    @staticmethod
    def find_spec(name: str, *_: object) -> None:
        """Raise ForeignPackageError for a foreign package; leave other names to the next hook."""
        if name in _find_foreign_places():
            refuse_foreign_packages()


@cache
def _find_foreign_places() -> dict[str, str]:
    """Return the places of packages that are not ours, by their names. Nothing is imported."""
    return {name: place for name in OWN_PACKAGES if (place := _find_foreign_place(name))}


def describe_foreign_packages() -> str:
    """Return the finding on foreign packages, without a full stop; empty without any."""
    listed = [f"{name} ({_find_distributions(name)}{place})" for name, place in _find_foreign_places().items()]
    return f"another package replaces a part of lobewatch: {', '.join(listed)}" if listed else ""


def _find_foreign_place(name: str) -> str:
    """Return the place of a package that is not ours, empty if it is ours."""
    try:
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            return "no files"
        return "" if OWN_INIT_TEXT in Path(spec.origin).read_bytes() else str(Path(spec.origin).parent)
    except (ValueError, OSError):  # imported without a specification, or from an archive
        return "unknown place"


def _find_distributions(name: str) -> str:
    """Return the other distributions with this package, for a sentence."""
    from importlib.metadata import packages_distributions

    owners = {*packages_distributions().get(name, ())} - {"lobewatch"}
    return f"of {' and '.join(sorted(owners))}, in " if owners else ""


def guard_imports() -> None:
    """Refuse the import of foreign packages from now on; called at the import of lobewatch.

    Raises
    ------
    ForeignPackageError
        A foreign package has been imported before lobewatch.
    """
    foreign = _find_foreign_places()
    if foreign:
        sys.meta_path.insert(0, _ImportGuard)
    if foreign.keys() & sys.modules.keys():
        refuse_foreign_packages()


def refuse_foreign_packages() -> None:
    """Raise ForeignPackageError if there are foreign packages."""
    if finding := describe_foreign_packages():
        raise ForeignPackageError(f"{finding}. {FOREIGN_PACKAGE_CURE}.")
