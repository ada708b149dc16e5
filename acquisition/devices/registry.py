"""All drivers there are: ours, and those that other packages register as `lobewatch.drivers`."""

from __future__ import annotations

from importlib.metadata import entry_points

from acquisition.devices.built_in import BUILT_IN
from acquisition.devices.driver import Driver
from acquisition.errors import DataError
from acquisition.plugin import load_plugin, not_loaded, package_of
from acquisition.remark import Remark

GROUP = "lobewatch.drivers"
"""Entry points of this group name a Driver each; the name is that of the driver."""


def driver_names() -> tuple[str, ...]:
    """Ours first; nothing is loaded."""
    ours = [driver.name for driver in BUILT_IN]
    return (*ours, *sorted({point.name for point in entry_points(group=GROUP)}.difference(ours)))


def find_driver(name: str) -> Driver:
    """The driver of this name; DataError where there is none, or where its package cannot be loaded."""
    driver = _find(name)
    if isinstance(driver, Remark):
        raise DataError(str(driver))
    return driver


def load_drivers() -> tuple[tuple[Driver, ...], tuple[Remark, ...]]:
    """All drivers, and a remark on each that cannot be loaded."""
    loaded = [_find(name) for name in driver_names()]
    drivers = tuple(entry for entry in loaded if isinstance(entry, Driver))
    return drivers, tuple(entry for entry in loaded if isinstance(entry, Remark))


def _find(name: str) -> Driver | Remark:
    for driver in BUILT_IN:
        if driver.name == name:
            return driver
    points = sorted(entry_points(group=GROUP, name=name), key=package_of)
    if not points:
        text = f"driver={name!r} is none of {', '.join(driver_names())}"
        return Remark("driver-not-known", "", text, "correct the name, or install the package that brings it")
    if len(points) > 1:
        packages = " and ".join(map(package_of, points))
        return not_loaded(Driver, points[0], f"the packages {packages} both bring it", "remove one of them")
    return load_plugin(points[0], Driver)
