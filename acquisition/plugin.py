"""Records that other packages bring, drivers and file formats, found as entry points."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from typing import Protocol, TypeVar

from acquisition.remark import Remark


class Named(Protocol):
    """What a package may bring."""

    @property
    def name(self) -> str:
        """That of its entry point."""
        ...


Plugin = TypeVar("Plugin", bound=Named)


def load_plugin(point: EntryPoint, kind: type[Plugin]) -> Plugin | Remark:
    """The record that an entry point names; a remark with the package where it cannot be used. Nothing else fails."""
    package = package_of(point)
    try:
        loaded = point.load()
    except Exception as error:  # noqa: BLE001  (a foreign package may fail in any way; ours go on)
        return not_loaded(kind, point, f"the package {package} cannot be loaded ({type(error).__name__}: {error})")
    if not isinstance(loaded, kind):
        return not_loaded(kind, point, f"{point.value} of the package {package} is no acquisition.{kind.__name__}")
    if loaded.name != point.name:
        return not_loaded(kind, point, f"the package {package} calls it {loaded.name!r} elsewhere")
    return loaded


def not_loaded(kind: type, point: EntryPoint, text: str, cure: str = "update or remove that package") -> Remark:
    """The remark on one that cannot be used."""
    return Remark("package-not-loaded", f"{kind.__name__.lower()} {point.name!r}", text, cure)


def package_of(point: EntryPoint) -> str:
    """Name of the package that an entry point belongs to."""
    return point.dist.name if point.dist else point.module
