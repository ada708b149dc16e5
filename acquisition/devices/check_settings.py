"""Whether settings fit a driver."""

from __future__ import annotations

from acquisition.devices.driver import DeviceSettings, Driver
from acquisition.devices.registry import named_package
from acquisition.errors import DataError


def check_settings(driver: Driver, settings: DeviceSettings) -> None:
    """ValueError for sensors that are not asked for or make no tap test, and for what the driver itself refuses."""
    if driver.sensors is None:
        _check_sensors(driver, settings)
    elif settings.inputs:
        raise ValueError(
            f"channel: {driver.title} names its own sensors: leave [[daq.channel]] out, or name another driver "
            '("dataq" takes them)'
        )
    if settings.printing and not driver.prints:
        raise ValueError(f'printing: [daq.printing] is for driver = "lines"; leave it out for {driver.title}')
    with named_package(driver.name, "checking [daq]", DataError):
        driver.check(settings)


def _check_sensors(driver: Driver, settings: DeviceSettings) -> None:
    quantities = sorted(sensor.channel.quantity for sensor in settings.inputs)
    if quantities.count("acceleration") == 0 or quantities.count("force") > 1:
        listed = ", ".join(quantities) or "nothing"
        raise ValueError(
            f'driver = "{driver.name}" needs two [[daq.channel]], one of force and one of acceleration; '
            f'here are {listed}; with hammer = "none" in [tap] that of acceleration alone'
        )
    directions = [sensor.channel.direction for sensor in settings.inputs if sensor.channel.quantity == "acceleration"]
    named = sorted(filter(None, directions))
    if len(directions) > 1 and (not named or len(set(named)) < len(named)):
        raise ValueError(
            f"{len(directions)} channels of acceleration: each that is tapped along needs its own "
            'direction = "x" or "y" in [[daq.channel]]'
        )
    numbers = [sensor.number for sensor in settings.inputs]
    for second, number in enumerate(numbers):
        if (first := numbers.index(number)) < second:
            text = f"channel {second + 1}: input={number} is that of channel {first + 1}; each sensor needs its own"
            raise ValueError(text)
