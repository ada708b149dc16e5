"""Questions about what is cut: the reference tool, the material, the first program."""

from __future__ import annotations

from typing import Any

from lobes import TOOL_MATERIALS, ToolMaterial
from lobewatch.machine.set_up.draft import Draft
from lobewatch.machine.set_up.question import SetUpQuestion
from lobewatch.machine.set_up.read_answer import OPEN, is_open, number_text, read_numbers
from lobewatch.machine.settings.edit_text import Value

FIRST = "first cut"
"""Name of the program, where nobody gives it one."""
COEFFICIENTS = ("tangential_n_per_mm2", "radial_n_per_mm2")
"""Keys that stand for a material ..."""
TEMPLATE = (700, 250)
"""... and their values in a new machine.toml, which are nobody's."""
_MADE_OF = f"{', '.join(TOOL_MATERIALS[:-1])} or {TOOL_MATERIALS[-1]}"


def _tool(draft: Draft) -> str:
    cut, stick_out = draft.table("reference_cut"), draft.table("tap").get("stick_out_mm")
    values = [cut.get("teeth", 4), cut.get("tool_diameter_mm", 20), cut.get("helix_deg", 30)]
    numbers = [number_text(value) for value in (*values, *([stick_out] if stick_out else []))]
    made_of = draft.table("tool", _number(draft)).get("tool_material")
    return " ".join([*numbers, *([made_of] if made_of else [])])


def _set_tool(draft: Draft, answer: str) -> Draft:
    names = (
        "teeth",
        "diameter in mm",
        "helix in deg",
        f"length out of the holder in mm (it and {_MADE_OF} may be left out)",
    )
    numbers, made_of = _apart(answer)
    teeth, diameter, helix, *stick_out = read_numbers(numbers, names, 3)
    if not teeth.is_integer():
        raise ValueError(f"{answer!r}: {teeth:g} teeth; the number of teeth comes first")
    draft = draft.set("tap", stick_out_mm=stick_out[0] if stick_out else None)
    tool: dict[str, Value] = {"teeth": int(teeth), "tool_diameter_mm": diameter, "helix_deg": helix}
    draft = _in_all_cuts(draft.set("reference_cut", radial_depth_mm=diameter), tool)
    number = _number(draft)
    if made_of is None and not draft.table("tool", number):
        return draft
    return draft.set("tool", number, name=draft.table("tap")["tool"], tool_material=made_of)


def _apart(answer: str) -> tuple[str, ToolMaterial | None]:
    """Numbers of a tool, and what it is made of where that stands behind them."""
    for material in sorted(TOOL_MATERIALS, key=len, reverse=True):
        if answer.strip().casefold().endswith(f" {material.casefold()}"):
            return answer.strip()[: -len(material)], material
    return answer, None


def _number(draft: Draft) -> int:
    """Number of the [[tool]] that is tapped, or of a new one."""
    number = 0
    while (tool := draft.table("tool", number)) and tool.get("name") != draft.table("tap")["tool"]:
        number += 1
    return number


def _material(draft: Draft) -> str:
    cut = draft.table("reference_cut")
    if "material" in cut:
        return str(cut["material"])
    pair = tuple(cut[key] for key in COEFFICIENTS if key in cut)
    return OPEN if pair in (TEMPLATE, ()) else " ".join(number_text(value) for value in pair)


def _set_material(draft: Draft, answer: str) -> Draft:
    if is_open(answer):
        return draft
    try:
        tangential, radial = read_numbers(answer, ("Kt", "Kr"))
        material = None
    except ValueError:
        tangential, radial, material = None, None, answer.strip()
    return _in_all_cuts(draft, {"material": material, **dict(zip(COEFFICIENTS, (tangential, radial), strict=True))})


def _in_all_cuts(draft: Draft, values: dict[str, Value]) -> Draft:
    """Reference cut and first program, where there is one."""
    draft = draft.set("reference_cut", **values)
    return draft.set("program", 0, **values) if draft.table("program", 0) else draft


def _program(draft: Draft) -> str:
    program = draft.table("program", 0)
    if not program:
        return OPEN
    keys = ("speed_rpm", "depth_mm", "radial_depth_mm", "feed_per_tooth_mm")
    return f"{program['name']}: " + " ".join(number_text(program[key]) for key in keys if key in program)


def _set_program(draft: Draft, answer: str) -> Draft:
    if is_open(answer):
        return draft
    name, colon, numbers = answer.rpartition(":")
    names = ("speed in rpm", "axial depth in mm", "radial depth in mm", "feed per tooth in mm (may be left out)")
    speed, depth, radial, *feed = read_numbers(numbers, names, 3)
    cut = draft.table("reference_cut")
    shared: dict[str, Any] = {key: cut[key] for key in cut if key not in ("radial_depth_mm", "feed_per_tooth_mm")}
    own: dict[str, Value] = {"name": name.strip() if colon else FIRST, "tool": draft.table("tap")["tool"]}
    setting = {"speed_rpm": speed, "depth_mm": depth, "radial_depth_mm": radial}
    return draft.set("program", 0, **own, **shared, **setting, feed_per_tooth_mm=feed[0] if feed else None)


TOOL = SetUpQuestion(
    "tool",
    f"The tool that is tapped: teeth, diameter (mm), helix (deg), length out of its holder (mm), of {_MADE_OF}?",
    "4 20 30 80 coated carbide",
    _tool,
    _set_tool,
)
MATERIAL = SetUpQuestion(
    "material",
    "What does it cut? A material (lobewatch materials lists them), or Kt and Kr (N/mm2)",
    "42CrMo4, 1.7225, AA 6061, 700 250",
    _material,
    _set_material,
)
PROGRAM = SetUpQuestion(
    "program",
    "The first cutting program: speed (rpm), axial depth, radial depth, feed per tooth (mm)?",
    "slot: 8000 2 20 0.1",
    _program,
    _set_program,
)
