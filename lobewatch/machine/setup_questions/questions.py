"""Setup questions on machine, DAQ, sensors, tool and cutting."""

from dataclasses import replace
from functools import partial
from typing import Any, get_args

from acquisition import DeviceSettings, find_driver, list_driver_names
from lobes import TOOL_MATERIALS, ToolMaterial
from lobewatch.machine.settings.cut_tables import CutTable, DriveTable
from lobewatch.machine.settings.display_units import LENGTH, length_argument, length_units
from lobewatch.machine.settings.number_text import ValueLimits, parse_numbers
from lobewatch.machine.settings.setting_questions import (
    DEPTH_RATIO_RANGE,
    RADIAL_DEPTH_RATIO_RANGE,
    TEMPLATE_COEFFICIENTS,
)
from lobewatch.machine.settings.setup_tables import ChannelTable, DaqTable, SensorMounting, SpeedTable, TapTable
from lobewatch.machine.settings.speed_range import parse_speed_range
from lobewatch.machine.settings.toml import TomlTable, TomlValue, find_plausible_ranges
from lobewatch.machine.settings.unit_text import POWER_UNITS
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
            raise ValueError(f"no DAQ has the number {answer}. Enter the port, such as /dev/ttyACM0.")
        answer = answering[number - 1]
    port, driver, rate = [*answer.split(maxsplit=2), "", ""][:3]
    if driver and driver not in list_driver_names():
        raise ValueError(f"unknown driver {driver!r}. Choose {', '.join(list_driver_names())}.")
    look = draft.detected_daqs.get(port) or setup.inspect_port(port)
    draft = replace(draft, detected_daqs={**draft.detected_daqs, port: look})
    driver = driver or look.driver
    draft = draft.set("daq", port=port, driver=None if driver == "taps" else driver)
    if rate:
        draft = draft.set("daq", sample_rate_hz=_parse_rate(rate))
    if find_driver(driver).prints_samples:
        find_driver(driver).check(DeviceSettings(draft.table("daq").get("sample_rate_hz")))
    return draft


def _parse_rate(answer: str) -> float:
    return parse_numbers(answer, ("sample rate in Hz",), limits=_limits(DaqTable, "sample_rate_hz"))[0]


def _limits(table: type[TomlTable], *keys: str) -> list[ValueLimits | None]:
    """Return the plausible range of keys of a table, None for a key without one."""
    ranges = find_plausible_ranges(table)
    return [ranges.get(key) for key in keys]


def _described_by_daq(quantity: str, draft: MachineDraft) -> str:
    if draft.needs_sensors or (quantity == "force" and _lacks_hammer(draft)):
        return ""
    says = draft.daq.sensor_text(quantity)
    return f"{says} (from the DAQ)" if says else "read from the DAQ"


def _lacks_hammer(draft: MachineDraft) -> bool:
    return bool(draft.daq.channels) and not draft.daq.sensor_text("force")


def _current_sensor(quantity: str, draft: MachineDraft) -> str:
    if quantity == "force" and (draft.has_no_force_sensor or _lacks_hammer(draft)):
        return NO_HAMMER_ANSWER
    channel = draft.table("daq.channel", draft.find_number("daq.channel", "quantity", quantity))
    if not channel:
        return ""
    return setup.format_answer(*(channel[key] for key in ("input", SENSITIVITY_KEYS[quantity], "range_v")))


def _set_sensor(quantity: str, draft: MachineDraft, answer: str) -> MachineDraft:
    if quantity == "force":
        if answer.strip().casefold() == NO_HAMMER_ANSWER:
            return draft.set("tap", hammer=NO_HAMMER_ANSWER, trigger_n=None)
        draft = draft.set("tap", hammer=None)
    names = ("DAQ input", f"sensitivity in {'mV/N' if quantity == 'force' else 'mV/g'}", "range in V")
    limits = _limits(ChannelTable, "input", SENSITIVITY_KEYS[quantity], "range_v")
    number, sensitivity, reach = parse_numbers(answer, names, limits=limits)
    if not number.is_integer():
        raise ValueError(f"{answer!r}: input {number:g} is not a whole number. Enter 0 for the first input.")
    values: dict[str, TomlValue] = {"input": int(number), "quantity": quantity, SENSITIVITY_KEYS[quantity]: sensitivity}
    place = draft.find_number("daq.channel", "quantity", quantity)
    return draft.set("daq.channel", place, **values, range_v=reach)


def _sensor_question(name: str, quantity: str, text: str, example: str) -> SetupQuestion:
    current, apply = partial(_current_sensor, quantity), partial(_set_sensor, quantity)
    return SetupQuestion(name, text, example, current, apply, partial(_described_by_daq, quantity))


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
    names = (f"the mass in g and one of {', '.join(MOUNTINGS)}",)
    mass = parse_numbers(rest, names, 0 if mountings else 1, _limits(TapTable, "sensor_mass_g"))
    return draft.set("tap", sensor_mass_g=mass[0] if mass else None, mounting=mountings[0] if mountings else None)


_DAQ_EXAMPLE = "/dev/ttyACM0, COM3, /dev/ttyUSB0 dataq, /dev/ttyACM0 lines 3200"
_FIXING_TEXT = f"Mass of the accelerometer (g) and mounting on the tool ({', '.join(MOUNTINGS)})"
DAQ_QUESTION = SetupQuestion(
    "daq", "Port of the DAQ, with driver and sample rate (Hz) if necessary", _DAQ_EXAMPLE, _current_port, _set_port
)


def _current_name(draft: MachineDraft) -> str:
    return str(draft.table("machine")["name"])


def _set_name(draft: MachineDraft, answer: str) -> MachineDraft:
    return draft.set("machine", name=answer.strip())


def _current_speeds(draft: MachineDraft) -> str:
    speed = draft.table("speed")
    return setup.format_answer(speed.get("low_rpm", 1000), speed.get("high_rpm", 24000))


def _set_speeds(draft: MachineDraft, answer: str) -> MachineDraft:
    low, high = parse_speed_range(answer)
    return draft.set("speed", low_rpm=low, high_rpm=high)


def _current_drive(draft: MachineDraft) -> str:
    drive = draft.table("drive")
    known = [drive[key] for key in ("power_kw", "torque_nm") if key in drive]
    return setup.format_answer(*known) if len(known) == 2 else setup.OPEN_ANSWER


def _set_drive(draft: MachineDraft, answer: str) -> MachineDraft:
    if setup.is_open_answer(answer):
        return draft.set("drive", power_kw=None, torque_nm=None) if draft.table("drive") else draft
    names, limits = ("power in kW", "torque in N m"), _limits(DriveTable, "power_kw", "torque_nm")
    power, torque = parse_numbers(answer, names, None, limits, [{"": 1.0} | POWER_UNITS])
    return draft.set("drive", power_kw=power, torque_nm=torque)


SETUP_COEFFICIENT_KEYS = ("tangential_n_per_mm2", "radial_n_per_mm2")
"""Keys of the coefficients that replace a material."""
_TOOL_MATERIALS_TEXT = f"{', '.join(TOOL_MATERIALS[:-1])} or {TOOL_MATERIALS[-1]}"


def _current_tool(draft: MachineDraft) -> str:
    cut, stick_out = draft.table("reference_cut"), draft.table("tap").get("stick_out_mm")
    diameter = length_argument(cut.get("tool_diameter_mm", 20), ".10g")
    values = [cut.get("teeth", 4), diameter, cut.get("helix_deg", 30)]
    made_of = draft.table("tool", draft.find_number("tool", "name", draft.table("tap")["tool"])).get("tool_material")
    numbers = setup.format_answer(*values, *([length_argument(stick_out, ".10g")] if stick_out else []))
    return f"{numbers} {made_of}" if made_of else numbers


def _set_tool(draft: MachineDraft, answer: str) -> MachineDraft:
    length = f"stick-out in {LENGTH.unit} (optional) and tool material (optional: {_TOOL_MATERIALS_TEXT})"
    numbers, made_of = _split_tool_answer(answer)
    names = ("flutes", f"diameter in {LENGTH.unit}", "helix in deg", length)
    limits = [*_limits(CutTable, "teeth", "tool_diameter_mm", "helix_deg"), *_limits(TapTable, "stick_out_mm")]
    teeth, diameter, helix, *stick_out = parse_numbers(
        numbers, names, 3, limits, (None, length_units(), None, length_units())
    )
    if not teeth.is_integer():
        raise ValueError(f"{answer!r}: {teeth:g} is not a number of flutes. Begin with a whole number.")
    draft = draft.set("tap", stick_out_mm=stick_out[0] if stick_out else None)
    tool: dict[str, TomlValue] = {"teeth": int(teeth), "tool_diameter_mm": diameter, "helix_deg": helix}
    draft = _set_in_all_cuts(draft.set("reference_cut", radial_depth_mm=diameter), tool)
    number = draft.find_number("tool", "name", draft.table("tap")["tool"])
    if made_of is None and not draft.table("tool", number):
        return draft
    return draft.set("tool", number, name=draft.table("tap")["tool"], tool_material=made_of)


def _split_tool_answer(answer: str) -> tuple[str, ToolMaterial | None]:
    """Split an answer into numbers and the tool material."""
    for material in sorted(TOOL_MATERIALS, key=len, reverse=True):
        if answer.strip().casefold().endswith(f" {material.casefold()}"):
            return answer.strip()[: -len(material)], material
    return answer, None


def _current_material(draft: MachineDraft) -> str:
    cut = draft.table("reference_cut")
    if "material" in cut:
        return str(cut["material"])
    pair = tuple(cut[key] for key in SETUP_COEFFICIENT_KEYS if key in cut)
    return setup.OPEN_ANSWER if pair in (TEMPLATE_COEFFICIENTS, ()) else setup.format_answer(*pair)


def _set_material(draft: MachineDraft, answer: str) -> MachineDraft:
    if setup.is_open_answer(answer):
        return draft
    values: dict[str, TomlValue] = {"material": None}
    limits = _limits(CutTable, *SETUP_COEFFICIENT_KEYS)
    try:
        numbers = parse_numbers(answer, ("Kt", "Kr"), limits=limits)
        values |= dict(zip(SETUP_COEFFICIENT_KEYS, numbers, strict=True))
    except ValueError:
        values |= {"material": answer.strip(), **dict.fromkeys(SETUP_COEFFICIENT_KEYS)}
    return _set_in_all_cuts(draft, values)


def _set_in_all_cuts(draft: MachineDraft, values: dict[str, TomlValue]) -> MachineDraft:
    """Set values of the reference cut and of the first program."""
    draft = draft.set("reference_cut", **values)
    return draft.set("program", 0, **values) if draft.table("program", 0) else draft


def _current_program(draft: MachineDraft) -> str:
    program = draft.table("program", 0)
    if not program:
        return setup.OPEN_ANSWER
    keys = ("depth_mm", "radial_depth_mm", "feed_per_tooth_mm")
    lengths = [length_argument(program[key], ".10g") for key in keys if key in program]
    return f"{program['name']}: {setup.format_answer(program['speed_rpm'], *lengths)}"


def _program_limits(draft: MachineDraft, diameter: float) -> list[ValueLimits | None]:
    """Return the range of the spindle, the plausible depths of a tool diameter (mm), and those of the feed."""
    speed = SpeedTable(**draft.table("speed"))
    depths = [(ratio.low * diameter, ratio.high * diameter) for ratio in (DEPTH_RATIO_RANGE, RADIAL_DEPTH_RATIO_RANGE)]
    return [(speed.low_rpm, speed.high_rpm), *depths, *_limits(CutTable, "feed_per_tooth_mm")]


def _set_program(draft: MachineDraft, answer: str) -> MachineDraft:
    if setup.is_open_answer(answer):
        return draft
    name, colon, numbers = answer.rpartition(":")
    names = ("speed in rpm", *(f"{what} in {LENGTH.unit}" for what in ("axial depth", "radial depth")))
    names = (*names, f"feed per tooth in {LENGTH.unit} (optional)")
    cut = draft.table("reference_cut")
    limits = _program_limits(draft, cut["tool_diameter_mm"])
    speed, depth, radial, *feed = parse_numbers(numbers, names, 3, limits, (None, *[length_units()] * 3))
    shared: dict[str, Any] = {key: cut[key] for key in cut if key not in ("radial_depth_mm", "feed_per_tooth_mm")}
    name = name.strip() if colon else "first cut"
    setting: dict[str, TomlValue] = {"speed_rpm": speed, "depth_mm": depth, "radial_depth_mm": radial}
    setting["feed_per_tooth_mm"] = feed[0] if feed else None
    return draft.set("program", 0, name=name, tool=draft.table("tap")["tool"], **shared, **setting)


_TOOL_TEXT = (
    "Flutes, diameter ({length}), helix (deg), stick-out ({length}) and material "
    f"({_TOOL_MATERIALS_TEXT}) of the tapped tool"
)
_MATERIAL_TEXT = "Workpiece material (lobes.materials_by_name lists all), or Kt and Kr (N/mm2)"
_MATERIAL_EXAMPLE = "42CrMo4, 1.7225, AA 6061, 700 250"
_PROGRAM_TEXT = "Speed (rpm), axial depth ap, radial depth ae and feed per tooth ({length}) of the first program"
_SENSOR_TEXT = "DAQ input, sensitivity from the calibration sheet (mV/{}), range (V)"
_DRIVE_TEXT = "Power (kW) and torque (N m) of the spindle motor"
_EXAMPLE_TOOL = "4 20mm 30 80mm coated carbide, 4 1/2in 30 3in carbide"
SETUP_QUESTIONS: tuple[SetupQuestion, ...] = (
    SetupQuestion("name", "Name of the machine", "mill-3", _current_name, _set_name),
    SetupQuestion("speeds", "Lowest and highest spindle speed (rpm)", "1000 18000", _current_speeds, _set_speeds),
    SetupQuestion("drive", _DRIVE_TEXT, "15 40", _current_drive, _set_drive),
    DAQ_QUESTION,
    _sensor_question(
        "hammer", "force", f"{_SENSOR_TEXT.format('N')}. Enter none if you have no force sensor.", "0 2.25 5"
    ),
    _sensor_question("accelerometer", "acceleration", _SENSOR_TEXT.format("g"), "1 10 5"),
    SetupQuestion("fixing", _FIXING_TEXT, "4.5 wax", _current_mounting, _set_mounting),
    SetupQuestion("tool", _TOOL_TEXT, _EXAMPLE_TOOL, _current_tool, _set_tool),
    SetupQuestion("material", _MATERIAL_TEXT, _MATERIAL_EXAMPLE, _current_material, _set_material),
    SetupQuestion(
        "program",
        _PROGRAM_TEXT,
        "slot: 8000 2mm 20mm 0.1mm, slot: 8000 0.08in 3/4in 0.004in",
        _current_program,
        _set_program,
    ),
)
"""All questions, in their order."""


def find_setup_question(name: str) -> SetupQuestion:
    """Return the question of a name; ValueError that lists all names."""
    by_name = {question.name: question for question in SETUP_QUESTIONS}
    if name not in by_name:
        raise ValueError(f"find_setup_question.name {name} is not a setup question. Choose {', '.join(by_name)}.")
    return by_name[name]
