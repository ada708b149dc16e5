"""Questions about what the machine is tapped with: DAQ, hammer, accelerometer."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import get_args

from acquisition import DeviceSettings, driver_names, find_driver
from lobewatch.machine.set_up.daq_look import look_at
from lobewatch.machine.set_up.draft import Draft
from lobewatch.machine.set_up.question import SetUpQuestion
from lobewatch.machine.set_up.read_answer import OPEN, is_open, number_text, read_numbers
from lobewatch.machine.settings.edit_text import Value
from lobewatch.machine.settings.sensor_loading import Mounting

SENSITIVITY = {"force": "sensitivity_mv_per_n", "acceleration": "sensitivity_mv_per_g"}
"""Key of the sensitivity of a sensor, by its quantity."""
WITHOUT = "none"
"""Answer of whoever has no force sensor."""


def _port(draft: Draft) -> str:
    daq = draft.table("daq")
    if port := daq.get("port"):
        rate = [number_text(daq["sample_rate_hz"])] if "sample_rate_hz" in daq else []
        return " ".join([port, *([daq["driver"], *rate] if "driver" in daq else [])])
    answering = [look.port for look in draft.looks.values() if look.text]
    return answering[0] if answering else OPEN


def _set_port(draft: Draft, answer: str) -> Draft:
    """Port, with driver and rate behind it where nobody answers there, or the number of one that was listed."""
    if is_open(answer):
        return draft.set("daq", port=None, driver=None)
    answering = [look.port for look in draft.looks.values() if look.text]
    if answer.strip().isdecimal():
        number = int(answer)
        if not 1 <= number <= len(answering):
            raise ValueError(f"{answer}: no DAQ of this number is listed; give the port, as in /dev/ttyACM0")
        answer = answering[number - 1]
    port, driver, rate = [*answer.split(maxsplit=2), "", ""][:3]
    if driver and driver not in driver_names():
        raise ValueError(f"driver {driver!r} is not known; there are {', '.join(driver_names())}")
    look = draft.looks.get(port) or look_at(port)
    draft = replace(draft, looks={**draft.looks, port: look})
    driver = driver or look.driver
    draft = draft.set("daq", port=port, driver=None if driver == "taps" else driver)
    if rate:
        draft = draft.set("daq", sample_rate_hz=read_numbers(rate, ("samples a second",))[0])
    if find_driver(driver).prints:
        find_driver(driver).check(DeviceSettings(draft.table("daq").get("sample_rate_hz")))
    return draft


def _number(quantity: str, draft: Draft) -> int:
    """Number of a sensor in [[daq.channel]], that of the next one where it is not there yet."""
    quantities = [channel.get("quantity") for channel in draft.table("daq").get("channel", ())]
    return quantities.index(quantity) if quantity in quantities else len(quantities)


def _known_by_daq(quantity: str, draft: Draft) -> str:
    if draft.needs_sensors or (quantity == "force" and _names_no_hammer(draft)):
        return ""
    says = draft.daq.sensor_text(quantity)
    return f"{says}, says the DAQ" if says else "the DAQ will say it itself"


def _names_no_hammer(draft: Draft) -> bool:
    return bool(draft.daq.channels) and not draft.daq.sensor_text("force")


def _sensor(quantity: str, draft: Draft) -> str:
    if quantity == "force" and (draft.without_force or _names_no_hammer(draft)):
        return WITHOUT
    channel = draft.table("daq.channel", _number(quantity, draft))
    if not channel:
        return ""
    return " ".join(number_text(channel[key]) for key in ("input", SENSITIVITY[quantity], "range_v"))


def _set_sensor(quantity: str, draft: Draft, answer: str) -> Draft:
    unit = "mV/N" if quantity == "force" else "mV/g"
    number, sensitivity, reach = read_numbers(answer, ("input of the DAQ", f"sensitivity in {unit}", "range in V"))
    if not number.is_integer():
        raise ValueError(f"{answer!r}: input {number:g} is none; inputs are counted 0, 1, 2 ...")
    values: dict[str, Value] = {
        "input": int(number),
        "quantity": quantity,
        SENSITIVITY[quantity]: sensitivity,
        "range_v": reach,
    }
    return draft.set("daq.channel", _number(quantity, draft), **values)


def _set_hammer(draft: Draft, answer: str) -> Draft:
    """A hammer with its sensor, or none."""
    if answer.strip().casefold() == WITHOUT:
        return draft.set("tap", hammer=WITHOUT, trigger_n=None)
    return _set_sensor("force", draft.set("tap", hammer=None), answer)


def _fixing(draft: Draft) -> str:
    tap = draft.table("tap")
    words = [number_text(tap["sensor_mass_g"])] if "sensor_mass_g" in tap else []
    return " ".join([*words, *([tap["mounting"]] if "mounting" in tap else [])]) or OPEN


def _set_fixing(draft: Draft, answer: str) -> Draft:
    if is_open(answer):
        return draft.set("tap", sensor_mass_g=None, mounting=None)
    words = [word.strip(",;") for word in answer.casefold().split()]
    mountings = [word for word in words if word in get_args(Mounting)]
    rest = " ".join(word for word in words if word not in get_args(Mounting))
    names = (f"mass in g, then {', '.join(get_args(Mounting))}",)
    mass = read_numbers(rest, names, 0 if mountings else 1)
    return draft.set("tap", sensor_mass_g=mass[0] if mass else None, mounting=mountings[0] if mountings else None)


DAQ = SetUpQuestion(
    "daq",
    "On which port is the DAQ?",
    "/dev/ttyACM0, COM3, /dev/ttyUSB0 dataq, /dev/ttyACM0 lines 3200",
    _port,
    _set_port,
)
HAMMER = SetUpQuestion(
    "hammer",
    "Hammer: input of the DAQ, sensitivity (mV/N, on its calibration sheet), range (V)? Or none: no force sensor.",
    "0 2.25 5",
    partial(_sensor, "force"),
    _set_hammer,
    partial(_known_by_daq, "force"),
)
ACCELEROMETER = SetUpQuestion(
    "accelerometer",
    "Accelerometer: input of the DAQ, sensitivity (mV/g, on its calibration sheet), range (V)?",
    "1 10 5",
    partial(_sensor, "acceleration"),
    partial(_set_sensor, "acceleration"),
    partial(_known_by_daq, "acceleration"),
)
FIXING = SetUpQuestion(
    "fixing",
    f"Accelerometer on the tool: its mass (g), and fixed by {', '.join(get_args(Mounting)[:-1])} or hand?",
    "4.5 wax",
    _fixing,
    _set_fixing,
)
