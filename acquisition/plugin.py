"""Load records of other packages (drivers, file formats) from entry points."""

from importlib.metadata import EntryPoint
from traceback import format_exception_only
from typing import Protocol, TypeVar

from acquisition.errors import Remark


class NamedRecord(Protocol):
    """Record that a package may provide."""

    @property
    def name(self) -> str:
        """Name of its entry point."""


Plugin = TypeVar("Plugin", bound=NamedRecord)
PLUGIN_ERRORS = (Exception, SystemExit)
"""Errors of a foreign package that do not end this program; Ctrl-C does."""


def load_plugin(point: EntryPoint, kind: type[Plugin]) -> Plugin | Remark:
    """Return the record that an entry point names, or a remark with the package if it cannot be used."""
    package = get_package_name(point)
    try:
        loaded = point.load()
    except PLUGIN_ERRORS as error:
        text = f"the package {package} cannot be loaded ({format_exception_line(error)})"
        return make_unusable_remark(kind, point.name, text)
    if not isinstance(loaded, kind):
        text = f"{point.value} of the package {package} is not an acquisition.{kind.__name__}"
        return make_unusable_remark(kind, point.name, text)
    if loaded.name != point.name:
        return make_unusable_remark(kind, point.name, f"the package {package} names this plugin {loaded.name!r}, too")
    return loaded


def make_unusable_remark(kind: type, name: str, text: str, cure: str = "Update or remove the package") -> Remark:
    return Remark("package-not-loaded", f"{kind.__name__.lower()} {name!r}", text, cure)


def format_exception_line(error: BaseException) -> str:
    """Return type and text of an error of a foreign package on one line."""
    return " ".join("".join(format_exception_only(error)).split())


def get_package_name(point: EntryPoint) -> str:
    return point.dist.name if point.dist else point.module
