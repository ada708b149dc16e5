"""Offer a check of the sensors with a known mass after a tap test at a terminal."""

from functools import partial

from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.sensors.sensor_checks import check_mass
from lobewatch.show.sensors import mass_check_texts
from lobewatch.show.terminal.output import emit, notes
from lobewatch.tap.device_connection import open_device
from lobewatch.tap.mass_check import read_mass


def offer_mass_check(folder: MachineFolder, tap_id: str, port: str, operator: str) -> None:
    """Ask for a known mass if nothing has checked the sensors of a finished tap test, and make the check.

    An empty answer leaves it for later: the check counts for tap tests before it.
    """
    logbook = Logbook(folder)
    check = logbook.chain_check(tap_id)
    if check.evidence is not None or not check.is_recorded:
        return
    question = (
        "Check the sensors with a known mass now (two minutes)? Mass with accelerometer (kg), or Enter for later: "
    )
    notes.print(question, end="", markup=False)
    mass = _ask_mass()
    if mass is None:
        return
    port = port or folder.machine.daq.port
    tell = partial(notes.print, markup=False)
    direction = next((tap.direction for tap in logbook.taps if tap.id == tap_id), "x")
    with folder.locked(), open_device(folder.machine.daq, port) as device:
        result = check_mass(folder, port, device, mass, tell, operator, direction)
    emit({}, False, *mass_check_texts(result))


def _ask_mass() -> float | None:
    """Return the mass that a person enters (kg); None for no mass."""
    while True:
        try:
            answer = input().strip()
            return read_mass(answer) if answer else None
        except EOFError:
            return None
        except ValueError as error:
            text = f"{error}\nMass in kg, such as 1.052, or Enter for later: "
            notes.print(text, end="", markup=False)
