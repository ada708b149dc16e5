"""Records that other packages bring, drivers and file formats, found as entry points."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from traceback import format_exception_only
from typing import Protocol, TypeVar

from acquisition.errors import Remark


class NamedRecord(Protocol):
    """What a package may bring."""

    @property
    def name(self) -> str:
        """That of its entry point."""
        ...


Plugin = TypeVar("Plugin", bound=NamedRecord)
PLUGIN_ERRORS = (Exception, SystemExit)
"""All that a foreign package may raise while ours go on; Ctrl-C ends ours."""


def load_plugin(point: EntryPoint, kind: type[Plugin]) -> Plugin | Remark:
    """The record that an entry point names; a remark with the package where it cannot be used. Nothing else fails."""
    package = get_package_name(point)
    try:
        loaded = point.load()
    except PLUGIN_ERRORS as error:
        return make_unusable_remark(
            kind, point.name, f"the package {package} cannot be loaded ({format_exception_line(error)})"
        )
    if not isinstance(loaded, kind):
        text = f"{point.value} of the package {package} is no acquisition.{kind.__name__}"
        return make_unusable_remark(kind, point.name, text)
    if loaded.name != point.name:
        return make_unusable_remark(kind, point.name, f"the package {package} calls it {loaded.name!r} elsewhere")
    return loaded


def make_unusable_remark(kind: type, name: str, text: str, cure: str = "update or remove that package") -> Remark:
    """The remark on one that cannot be used."""
    return Remark("package-not-loaded", f"{kind.__name__.lower()} {name!r}", text, cure)


def format_exception_line(error: BaseException) -> str:
    """Kind and text of an error of a foreign package on one line, whatever its text is or does."""
    return " ".join("".join(format_exception_only(error)).split())


def get_package_name(point: EntryPoint) -> str:
    """Name of the package that an entry point belongs to."""
    return point.dist.name if point.dist else point.module
