"""All drivers there are: ours, and those that other packages register as `lobewatch.drivers`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points

from acquisition.devices.built_in import BUILT_IN
from acquisition.devices.driver import Driver
from acquisition.errors import DataError, DeviceError
from acquisition.plugin import FAILURES, load_plugin, not_usable, package_of, words_of
from acquisition.remark import Remark

GROUP = "lobewatch.drivers"
"""Entry points of this group name a Driver each; the name is that of the driver."""


def driver_names() -> tuple[str, ...]:
    """Names of all drivers that are installed, ours first; nothing is loaded."""
    ours = [driver.name for driver in BUILT_IN]
    return (*ours, *sorted({point.name for point in entry_points(group=GROUP)}.difference(ours)))


def find_driver(name: str) -> Driver:
    """The driver of this name; DataError where there is none, or where its package cannot be loaded.

    >>> find_driver("taps").title
    'a TAPS/1 device'
    >>> find_driver("tap")
    Traceback (most recent call last):
        ...
    acquisition.errors.DataError: driver='tap' is none of taps, dataq, lines, audio, nidaqmx, mcc172, ...
    """
    driver = _find(name)
    if isinstance(driver, Remark):
        raise DataError(str(driver))
    return driver


def load_drivers() -> tuple[tuple[Driver, ...], tuple[Remark, ...]]:
    """All drivers, and a remark on each that cannot be loaded."""
    loaded = [_find(name) for name in driver_names()]
    drivers = tuple(entry for entry in loaded if isinstance(entry, Driver))
    return drivers, tuple(entry for entry in loaded if isinstance(entry, Remark))


def not_answering(name: str, text: str) -> Remark:
    """The remark on a driver whose package fails when it is asked."""
    return not_usable(Driver, name, f"the package {_package(name)} {text}")


@contextmanager
def named_package(name: str, doing: str, kind: type[DeviceError | DataError] = DeviceError) -> Iterator[None]:
    """Where a driver of another package is called: what it may not raise becomes such an error, with its name."""
    try:
        yield
    except (OSError, ValueError):
        raise
    except FAILURES as error:
        raise kind(str(not_answering(name, f"fails when {doing} ({words_of(error)})"))) from error


def _package(name: str) -> str:
    """The package that brings a driver."""
    return " and ".join(map(package_of, entry_points(group=GROUP, name=name))) or "lobewatch"


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
        return not_usable(Driver, name, f"the packages {packages} both bring it", "remove one of them")
    return load_plugin(points[0], Driver)
