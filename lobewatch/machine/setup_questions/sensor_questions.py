"""Setup questions on DAQ, hammer and accelerometer."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import get_args

from acquisition import DeviceSettings, find_driver, list_driver_names
from lobewatch.machine.settings.setup_tables import SensorMounting
from lobewatch.machine.settings.toml_text import TomlValue
from lobewatch.machine.setup_questions import draft as setup
from lobewatch.machine.setup_questions.draft import MachineDraft, SetupQuestion

SENSITIVITY_KEYS = {"force": "sensitivity_mv_per_n", "acceleration": "sensitivity_mv_per_g"}
"""Key of the sensitivity of a sensor by quantity."""
MOUNTINGS: tuple[str, ...] = get_args(SensorMounting)
"""Words for the mounting of an accelerometer."""
NO_HAMMER_ANSWER = "none"
"""Answer without a force sensor."""


def _current_port(draft: MachineDraft) -> str:
    daq = draft.table("daq")
    if port := daq.get("port"):
        rate = [setup.format_answer(daq["sample_rate_hz"])] if "sample_rate_hz" in daq else []
        return " ".join([port, *([daq["driver"], *rate] if "driver" in daq else [])])
    answering = [look.port for look in draft.detected_daqs.values() if look.text]
    return answering[0] if answering else setup.OPEN_ANSWER


def _set_port(draft: MachineDraft, answer: str) -> MachineDraft:
    """Set a port, with driver and rate after it for a silent device, or the number of a listed one."""
    if setup.is_open_answer(answer):
        return draft.set("daq", port=None, driver=None)
    answering = [look.port for look in draft.detected_daqs.values() if look.text]
    if answer.strip().isdecimal():
        number = int(answer)
        if not 1 <= number <= len(answering):
            raise ValueError(f"{answer}: no DAQ of this number is listed; give the port, as in /dev/ttyACM0")
        answer = answering[number - 1]
    port, driver, rate = [*answer.split(maxsplit=2), "", ""][:3]
    if driver and driver not in list_driver_names():
        raise ValueError(f"driver {driver!r} is not known; there are {', '.join(list_driver_names())}")
    look = draft.detected_daqs.get(port) or setup.inspect_port(port)
    draft = replace(draft, detected_daqs={**draft.detected_daqs, port: look})
    driver = driver or look.driver
    draft = draft.set("daq", port=port, driver=None if driver == "taps" else driver)
    if rate:
        draft = draft.set("daq", sample_rate_hz=setup.parse_numbers(rate, ("samples a second",))[0])
    if find_driver(driver).prints_samples:
        find_driver(driver).check(DeviceSettings(draft.table("daq").get("sample_rate_hz")))
    return draft


def _channel_number(quantity: str, draft: MachineDraft) -> int:
    """Return the index of a sensor in [[daq.channel]], or of a new one."""
    quantities = [channel.get("quantity") for channel in draft.table("daq").get("channel", ())]
    return quantities.index(quantity) if quantity in quantities else len(quantities)


def _described_by_daq(quantity: str, draft: MachineDraft) -> str:
    if draft.needs_sensors or (quantity == "force" and _lacks_hammer(draft)):
        return ""
    says = draft.daq.sensor_text(quantity)
    return f"{says}, says the DAQ" if says else "the DAQ will say it itself"


def _lacks_hammer(draft: MachineDraft) -> bool:
    return bool(draft.daq.channels) and not draft.daq.sensor_text("force")


def _current_sensor(quantity: str, draft: MachineDraft) -> str:
    if quantity == "force" and (draft.has_no_force_sensor or _lacks_hammer(draft)):
        return NO_HAMMER_ANSWER
    channel = draft.table("daq.channel", _channel_number(quantity, draft))
    if not channel:
        return ""
    return setup.format_answer(*(channel[key] for key in ("input", SENSITIVITY_KEYS[quantity], "range_v")))


def _set_sensor(quantity: str, draft: MachineDraft, answer: str) -> MachineDraft:
    names = ("input of the DAQ", f"sensitivity in {'mV/N' if quantity == 'force' else 'mV/g'}", "range in V")
    number, sensitivity, reach = setup.parse_numbers(answer, names)
    if not number.is_integer():
        raise ValueError(f"{answer!r}: input {number:g} is none; inputs are counted 0, 1, 2 ...")
    values: dict[str, TomlValue] = {"input": int(number), "quantity": quantity, SENSITIVITY_KEYS[quantity]: sensitivity}
    return draft.set("daq.channel", _channel_number(quantity, draft), **values, range_v=reach)


def _set_hammer(draft: MachineDraft, answer: str) -> MachineDraft:
    if answer.strip().casefold() == NO_HAMMER_ANSWER:
        return draft.set("tap", hammer=NO_HAMMER_ANSWER, trigger_n=None)
    return _set_sensor("force", draft.set("tap", hammer=None), answer)


def _current_mounting(draft: MachineDraft) -> str:
    tap = draft.table("tap")
    words = [setup.format_answer(tap["sensor_mass_g"])] if "sensor_mass_g" in tap else []
    return " ".join([*words, *([tap["mounting"]] if "mounting" in tap else [])]) or setup.OPEN_ANSWER


def _set_mounting(draft: MachineDraft, answer: str) -> MachineDraft:
    if setup.is_open_answer(answer):
        return draft.set("tap", sensor_mass_g=None, mounting=None)
    words = [word.strip(",;") for word in answer.casefold().split()]
    mountings = [word for word in words if word in MOUNTINGS]
    rest = " ".join(word for word in words if word not in MOUNTINGS)
    names = (f"mass in g, then {', '.join(MOUNTINGS)}",)
    mass = setup.parse_numbers(rest, names, 0 if mountings else 1)
    return draft.set("tap", sensor_mass_g=mass[0] if mass else None, mounting=mountings[0] if mountings else None)


_DAQ_EXAMPLE = "/dev/ttyACM0, COM3, /dev/ttyUSB0 dataq, /dev/ttyACM0 lines 3200"
_FIXING_TEXT = f"Accelerometer on the tool: its mass (g), and fixed by {', '.join(MOUNTINGS[:-1])} or hand?"
DAQ_QUESTION = SetupQuestion("daq", "On which port is the DAQ?", _DAQ_EXAMPLE, _current_port, _set_port)
SENSOR_QUESTIONS = (
    DAQ_QUESTION,
    SetupQuestion(
        "hammer",
        "Hammer: input of the DAQ, sensitivity (mV/N, on its calibration sheet), range (V)? Or none: no force sensor.",
        "0 2.25 5",
        partial(_current_sensor, "force"),
        _set_hammer,
        partial(_described_by_daq, "force"),
    ),
    SetupQuestion(
        "accelerometer",
        "Accelerometer: input of the DAQ, sensitivity (mV/g, on its calibration sheet), range (V)?",
        "1 10 5",
        partial(_current_sensor, "acceleration"),
        partial(_set_sensor, "acceleration"),
        partial(_described_by_daq, "acceleration"),
    ),
    SetupQuestion("fixing", _FIXING_TEXT, "4.5 wax", _current_mounting, _set_mounting),
)
