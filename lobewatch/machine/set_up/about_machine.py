"""Questions about the machine: its name, its speeds, its drive."""

from __future__ import annotations

from lobewatch.machine.set_up.draft import Draft
from lobewatch.machine.set_up.question import SetUpQuestion
from lobewatch.machine.set_up.read_answer import OPEN, is_open, number_text, read_numbers


def _name(draft: Draft) -> str:
    return str(draft.table("machine")["name"])


def _set_name(draft: Draft, answer: str) -> Draft:
    return draft.set("machine", name=answer.strip())


def _speeds(draft: Draft) -> str:
    speed = draft.table("speed")
    return f"{number_text(speed.get('low_rpm', 1000))} {number_text(speed.get('high_rpm', 24000))}"


def _set_speeds(draft: Draft, answer: str) -> Draft:
    low, high = read_numbers(answer, ("lowest speed in rpm", "highest speed in rpm"))
    return draft.set("speed", low_rpm=low, high_rpm=high)


def _drive(draft: Draft) -> str:
    drive = draft.table("drive")
    known = [number_text(drive[key]) for key in ("power_kw", "torque_nm") if key in drive]
    return " ".join(known) if len(known) == 2 else OPEN


def _set_drive(draft: Draft, answer: str) -> Draft:
    if is_open(answer):
        return draft.set("drive", power_kw=None, torque_nm=None) if draft.table("drive") else draft
    power, torque = read_numbers(answer, ("power in kW", "torque in N m"))
    return draft.set("drive", power_kw=power, torque_nm=torque)


MACHINE = SetUpQuestion("name", "What is the machine called?", "mill-3", _name, _set_name)
SPEEDS = SetUpQuestion("speeds", "Lowest and highest spindle speed (rpm)?", "1000 18000", _speeds, _set_speeds)
DRIVE = SetUpQuestion("drive", "Power (kW) and torque (N m) of the spindle motor?", "15 40", _drive, _set_drive)
