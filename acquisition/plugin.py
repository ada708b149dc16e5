"""Records that other packages bring, drivers and file formats, found as entry points."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from traceback import format_exception_only
from typing import Protocol, TypeVar

from acquisition.remark import Remark


class Named(Protocol):
    """What a package may bring."""

    @property
    def name(self) -> str:
        """That of its entry point."""
        ...


Plugin = TypeVar("Plugin", bound=Named)
FAILURES = (Exception, SystemExit)
"""All that a foreign package may raise while ours go on; Ctrl-C ends ours."""


def load_plugin(point: EntryPoint, kind: type[Plugin]) -> Plugin | Remark:
    """The record that an entry point names; a remark with the package where it cannot be used. Nothing else fails."""
    package = package_of(point)
    try:
        loaded = point.load()
    except FAILURES as error:
        return not_usable(kind, point.name, f"the package {package} cannot be loaded ({words_of(error)})")
    if not isinstance(loaded, kind):
        text = f"{point.value} of the package {package} is no acquisition.{kind.__name__}"
        return not_usable(kind, point.name, text)
    if loaded.name != point.name:
        return not_usable(kind, point.name, f"the package {package} calls it {loaded.name!r} elsewhere")
    return loaded


def not_usable(kind: type, name: str, text: str, cure: str = "update or remove that package") -> Remark:
    """The remark on one that cannot be used."""
    return Remark("package-not-loaded", f"{kind.__name__.lower()} {name!r}", text, cure)


def words_of(error: BaseException) -> str:
    """Kind and text of an error of a foreign package on one line, whatever its text is or does."""
    return " ".join("".join(format_exception_only(error)).split())


def package_of(point: EntryPoint) -> str:
    """Name of the package that an entry point belongs to."""
    return point.dist.name if point.dist else point.module
