"""All drivers there are: ours, and those that other packages register as `lobewatch.drivers`."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

from acquisition.devices.built_in import BUILT_IN
from acquisition.devices.driver import Driver
from acquisition.errors import DataError
from acquisition.remark import Remark

GROUP = "lobewatch.drivers"
"""Entry points of this group name a Driver each; the name is that of the driver."""


def driver_names() -> tuple[str, ...]:
    """Ours first; nothing is loaded."""
    ours = [driver.name for driver in BUILT_IN]
    return (*ours, *sorted({point.name for point in entry_points(group=GROUP)}.difference(ours)))


def find_driver(name: str) -> Driver:
    """The driver of this name; DataError where there is none, or where its package cannot be loaded."""
    found = _find(name)
    if isinstance(found, Remark):
        raise DataError(str(found))
    return found


def load_drivers() -> tuple[tuple[Driver, ...], tuple[Remark, ...]]:
    """All drivers, and a remark on each that cannot be loaded."""
    found = [_find(name) for name in driver_names()]
    drivers = tuple(one for one in found if isinstance(one, Driver))
    return drivers, tuple(one for one in found if isinstance(one, Remark))


def _find(name: str) -> Driver | Remark:
    for driver in BUILT_IN:
        if driver.name == name:
            return driver
    points = sorted(entry_points(group=GROUP, name=name), key=_package)
    if not points:
        text = f"driver={name!r} is none of {', '.join(driver_names())}"
        return Remark("driver-not-known", "", text, "correct the name, or install the package that brings it")
    if len(points) > 1:
        packages = " and ".join(map(_package, points))
        return _remark(name, f"the packages {packages} both bring it", "remove one of them")
    return _load(points[0])


def _load(point: EntryPoint) -> Driver | Remark:
    cure = "update or remove that package"
    try:
        loaded = point.load()
    except Exception as error:  # noqa: BLE001  (a foreign package may fail in any way; ours go on)
        reason = f"the package {_package(point)} cannot be loaded ({type(error).__name__}: {error})"
        return _remark(point.name, reason, cure)
    if not isinstance(loaded, Driver):
        return _remark(point.name, f"{point.value} of the package {_package(point)} is no acquisition.Driver", cure)
    if loaded.name != point.name:
        return _remark(point.name, f"the package {_package(point)} calls it {loaded.name!r} elsewhere", cure)
    return loaded


def _remark(name: str, text: str, cure: str) -> Remark:
    return Remark("driver-not-loaded", f"driver {name!r}", text, cure)


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist else point.module
