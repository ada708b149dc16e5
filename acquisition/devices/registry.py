"""Find, load, query and check device drivers, including those of other packages."""

import queue
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points

from acquisition.devices.drivers import BUILT_IN_DRIVERS, DeviceSettings, Driver
from acquisition.errors import DataError, DeviceError, Remark
from acquisition.plugin import PLUGIN_ERRORS, format_exception_line, get_package_name, load_plugin, make_unusable_remark

DRIVER_ENTRY_POINTS = "lobewatch.drivers"
"""Entry point group. Each entry point names a Driver by the driver's name."""


def list_driver_names() -> tuple[str, ...]:
    """List the names of all installed drivers, built-in ones first. Nothing is loaded.

    Returns
    -------
    tuple of str
        Driver names.
    """
    ours = [driver.name for driver in BUILT_IN_DRIVERS]
    return (*ours, *sorted({point.name for point in entry_points(group=DRIVER_ENTRY_POINTS)}.difference(ours)))


def find_driver(name: str) -> Driver:
    """Find a driver by name.

    Parameters
    ----------
    name
        Name, as in [daq] driver of machine.toml.

    Returns
    -------
    Driver
        Built-in driver, or that of another package.

    Raises
    ------
    DataError
        There is no such driver, or its package cannot be loaded.

    Examples
    --------
    >>> find_driver("taps").title
    'a TAPS/1 device'
    >>> find_driver("tap")
    Traceback (most recent call last):
        ...
    acquisition.errors.DataError: driver='tap' is not one of taps, dataq, lines, audio, nidaqmx, mcc172, ...
    """
    driver = _load_driver(name)
    if isinstance(driver, Remark):
        raise DataError(str(driver))
    return driver


def load_drivers() -> tuple[tuple[Driver, ...], tuple[Remark, ...]]:
    """Load all drivers.

    Returns
    -------
    drivers : tuple of Driver
        Drivers that can be used.
    remarks : tuple of Remark
        One remark for each driver that cannot be loaded.
    """
    loaded = [_load_driver(name) for name in list_driver_names()]
    drivers = tuple(entry for entry in loaded if isinstance(entry, Driver))
    return drivers, tuple(entry for entry in loaded if isinstance(entry, Remark))


def driver_failure_remark(name: str, text: str) -> Remark:
    """Return the remark on a driver whose package fails."""
    package = " and ".join(map(get_package_name, entry_points(group=DRIVER_ENTRY_POINTS, name=name))) or "lobewatch"
    return make_unusable_remark(Driver, name, f"the package {package} {text}")


@contextmanager
def convert_driver_errors(name: str, doing: str, kind: type[DeviceError | DataError] = DeviceError) -> Iterator[None]:
    """Convert unexpected exceptions of a driver of another package to an error that names it.

    Parameters
    ----------
    name
        Name of the driver.
    doing
        What the driver is called for, e.g. "opening COM3".
    kind
        Exception to raise.

    Returns
    -------
    context manager
        Context in which the driver is called. OSError and ValueError pass unchanged.
    """
    try:
        yield
    except (OSError, ValueError):
        raise
    except PLUGIN_ERRORS as error:
        raise kind(str(driver_failure_remark(name, f"fails when {doing} ({format_exception_line(error)})"))) from error


def _load_driver(name: str) -> Driver | Remark:
    if (ours := next((driver for driver in BUILT_IN_DRIVERS if driver.name == name), None)) is not None:
        return ours
    points = sorted(entry_points(group=DRIVER_ENTRY_POINTS, name=name), key=get_package_name)
    if not points:
        text = f"driver={name!r} is not one of {', '.join(list_driver_names())}"
        return Remark("driver-not-known", "", text, "Correct the name, or install the package with this driver")
    if len(points) > 1:
        packages = " and ".join(map(get_package_name, points))
        text = f"the packages {packages} both provide this driver"
        return make_unusable_remark(Driver, name, text, "Remove one of these packages")
    return load_plugin(points[0], Driver)


DRIVER_ANSWER_TIMEOUT = 10.0
"""Time limit for the answer of a driver (s), three times what the built-in ones take, chosen."""


def query_driver(name: str, question: Callable[[], object], doing: str) -> object:
    """Query a driver in a thread, so that a failing or hanging driver stops nothing else.

    Returns the answer, None for a DeviceError (unplugged meanwhile), or a Remark if the driver fails or hangs. doing:
    description of the call, e.g. "probing COM3".
    """
    answers = queue.SimpleQueue[object]()

    def ask() -> None:
        try:
            answers.put(question())
        except BaseException as error:  # noqa: BLE001  (of another package: it ends nothing of ours)
            answers.put(error)

    threading.Thread(target=ask, name=f"question to {name}", daemon=True).start()
    try:
        answer = answers.get(timeout=DRIVER_ANSWER_TIMEOUT)
    except queue.Empty:
        return driver_failure_remark(name, f"does not answer within {DRIVER_ANSWER_TIMEOUT:g} s when {doing}")
    if isinstance(answer, DeviceError):
        return None
    if isinstance(answer, BaseException):
        return driver_failure_remark(name, f"fails when {doing} ({format_exception_line(answer)})")
    return answer


def check_settings(driver: Driver, settings: DeviceSettings) -> None:
    """Check whether settings fit a driver.

    Parameters
    ----------
    driver
        Driver of the device.
    settings
        Settings to check.

    Raises
    ------
    ValueError
        Sensors are missing, not expected or unfit for a tap test, or the driver rejects the settings.
    DataError
        The package of the driver fails.
    """
    if driver.sensor_data is None:
        _check_sensors(driver, settings)
    elif settings.inputs:
        cure = "Remove every [[daq.channel]], or choose another driver, such as dataq."
        raise ValueError(f"channel: {driver.title} reports its own sensors. {cure}")
    if settings.printing and not driver.prints_samples:
        raise ValueError('printing: only driver = "lines" uses [daq.printing]. Remove the table [daq.printing].')
    with convert_driver_errors(driver.name, "checking [daq]", DataError):
        driver.check(settings)


def _check_sensors(driver: Driver, settings: DeviceSettings) -> None:
    quantities = sorted(sensor.channel.quantity for sensor in settings.inputs)
    if quantities.count("acceleration") == 0 or quantities.count("force") > 1:
        found = f'driver = "{driver.name}" has [[daq.channel]] for {", ".join(quantities) or "nothing"}'
        cure = 'Give one channel of force and one of acceleration (with hammer = "none" in [tap] only acceleration).'
        raise ValueError(f"{found}. {cure}")
    directions = [sensor.channel.direction for sensor in settings.inputs if sensor.channel.quantity == "acceleration"]
    named = sorted(filter(None, directions))
    if len(directions) > 1 and (not named or len(set(named)) < len(named)):
        cure = 'Give each [[daq.channel]] of acceleration its own direction, "x" or "y".'
        raise ValueError(f"{len(directions)} channels of acceleration have directions {directions}. {cure}")
    numbers = [sensor.number for sensor in settings.inputs]
    for second, number in enumerate(numbers, 1):
        if (first := numbers.index(number) + 1) < second:
            found = f"channel {second}: input={number} is already used by channel {first}"
            raise ValueError(f"{found}. Give each channel its own input.")
