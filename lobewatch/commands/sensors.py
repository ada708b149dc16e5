"""Command `lobewatch sensors`: check hammer, accelerometer and DAQ."""

from functools import partial
from typing import Annotated, Literal

from typer import Exit, Option

from lobewatch.commands.shared_options import Machine, mass
from lobewatch.show.terminal.output import Json, emit, notes


def sensors(
    machine: Machine,
    port: Annotated[str, Option(help="Serial port of the DAQ, or socket://HOST:PORT. Default: [daq] port.")] = "",
    mass_kg: Annotated[
        float | None, Option(parser=mass, help="Suspended mass with accelerometer (kg), 0.05 to 50, to check F = m a.")
    ] = None,
    direction: Annotated[
        Literal["x", "y"], Option(help="Accelerometer on the mass, if the DAQ has one for each direction.")
    ] = "x",
    operator: Annotated[str, Option(help="Name of the operator of the mass check.")] = "",
    skew: Annotated[bool, Option("--skew", help="Measure the skew of two inputs joined to one signal.")] = False,
    as_json: Json = False,
) -> None:
    """Check hammer, accelerometer and DAQ.

    Without options: channels, calibration dates, implausible values, and the sample rate against the clock.
    The journal keeps the check with a known mass. It counts for all tap tests with the same DAQ and sensitivities.

    Examples
    --------
      lobewatch sensors mill-3 --port /dev/ttyACM0
      lobewatch sensors mill-3 --mass-kg 1.052
      lobewatch sensors mill-3 --skew
    """
    from lobewatch.logbook import Logbook
    from lobewatch.machine.folder import MachineFolder
    from lobewatch.notify.publish_status import publish_on_change
    from lobewatch.sensors.sensor_checks import check_mass, check_skew, list_sensors
    from lobewatch.show import sensors as show
    from lobewatch.tap.device_connection import open_device

    folder, print_note = MachineFolder(machine), partial(notes.print, markup=False)
    port = port or folder.machine.daq.port
    if not port:
        raise ValueError(f"no port. Give --port, or port in [daq] of {folder.toml}.")
    if mass_kg is not None and skew:
        raise ValueError("--mass-kg and --skew need different cabling. Leave out one of the two options.")
    with publish_on_change(Logbook(folder)), folder.locked(), open_device(folder.machine.daq, port) as device:
        if mass_kg is not None:
            mass_check = check_mass(folder, port, device, mass_kg, print_note, operator, direction)
            emit(show.mass_check_json(mass_check), as_json, *show.mass_check_texts(mass_check))
        elif skew:
            skew_check = check_skew(folder, port, device, print_note)
            emit(show.skew_check_json(skew_check), as_json, *show.skew_check_texts(skew_check))
        else:
            sensor_list = list_sensors(folder, device, print_note)
            emit(show.sensors_json(sensor_list), as_json, *show.sensors_texts(sensor_list))
            if sensor_list.errors:
                raise Exit(2)
