"""Command `lobewatch init`: create a machine folder."""

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from lobewatch.commands.shared_options import FolderArgument
from lobewatch.machine.settings.display_units import UnitSystem, shown_units
from lobewatch.show.terminal.output import Json, emit, notes

if TYPE_CHECKING:
    from lobewatch.machine.setup_questions.draft import MachineDraft

Answer = str | None


def init(
    machine: Annotated[Path, FolderArgument(help="New machine folder.")],
    example: Annotated[bool, Option("--example", help="Start from the example spindle with three programs.")] = False,
    yes: Annotated[bool, Option("--yes", help="Ask nothing. Settings without an option stay unchanged.")] = False,
    edit: Annotated[str, Option(help="Ask one question again, named by its option: --edit drive.")] = "",
    units: Annotated[UnitSystem | None, Option(help="Units of lengths in answers and results.")] = None,
    name: Annotated[Answer, Option(help="Machine name.")] = None,
    speeds: Annotated[Answer, Option(help='Lowest and highest spindle speed (rpm): "1000 18000".')] = None,
    drive: Annotated[Answer, Option(help='Spindle power (kW) and torque (N m): "15 40".')] = None,
    daq: Annotated[
        Answer, Option(help='DAQ port, driver, sample rate (Hz): "COM3", "COM3 dataq", "COM3 lines 3200".')
    ] = None,
    hammer: Annotated[
        Answer, Option(help='Hammer input, sensitivity (mV/N), range (V): "0 2.25 5", or none (not with TAPS/1).')
    ] = None,
    accelerometer: Annotated[
        Answer, Option(help='Accelerometer input, sensitivity (mV/g), range (V): "1 10 5".')
    ] = None,
    fixing: Annotated[Answer, Option(help='Accelerometer mass (g) and mounting: "4 wax".')] = None,
    tool: Annotated[
        Answer, Option(help='Flutes, diameter (mm), helix (deg), stick-out (mm), material: "4 20 30 80 carbide".')
    ] = None,
    material: Annotated[Answer, Option(help='Workpiece material: 42CrMo4, or Kt and Kr (N/mm2): "1400 500".')] = None,
    program: Annotated[
        Answer, Option(help='Spindle speed (rpm), ap (mm), ae (mm), feed per tooth (mm): "8000 2 20".')
    ] = None,
    as_json: Json = False,
) -> None:
    """Make a machine folder with a commented machine.toml.

    At a terminal, lobewatch init asks ten questions. With --yes, or without a terminal, only options set values.

    Examples
    --------
      lobewatch init mill-3
      lobewatch init mill-3 --edit tool
      lobewatch init mill-3 --yes --daq COM3 --tool "4 20 30 80" --material 42CrMo4 --program "slot: 8000 2 20"
      lobewatch init trial --example
    """
    from lobewatch.machine.folder_files import make_machine_text, write_machine_file

    asked = {"name": name, "speeds": speeds, "drive": drive, "daq": daq, "hammer": hammer, "fixing": fixing}
    asked |= {"accelerometer": accelerometer, "tool": tool, "material": material, "program": program}
    answers = {key: answer for key, answer in asked.items() if answer is not None}
    asks = sys.stdin.isatty() and notes.is_terminal and not (yes or as_json or example)
    toml = machine / "machine.toml"
    if edit:
        from lobewatch.machine.folder import MachineFolder

        text = MachineFolder(machine).toml_text
    else:
        text = make_machine_text(machine, "surrogate_machine.toml" if example else "new_machine.toml")
    next_step = f"lobewatch tap {shlex.quote(str(machine))}"
    if asks or answers or edit or units:
        draft = _answer_settings(text, answers, edit, asks, units)
        text, next_step = draft.text, next_step if draft.daq.port else f"{next_step} --port PORT"
    else:
        change = "adapt machine.toml to your machine" if example else "fill in machine.toml"
        next_step = f"{change}, then run: {next_step} --port PORT"
    write_machine_file(machine, text)
    payload, text = {"machine": str(machine), "machine_toml": str(toml)}, f"{'changed' if edit else 'created'} {toml}"
    emit(payload, as_json, text, f"next: {next_step}")
    if not as_json:
        command = f"lobewatch sensors {shlex.quote(str(machine))} --mass-kg KG"
        notes.print(f"then check the sensors with a known mass (two minutes): {command}", markup=False)


def _answer_settings(
    text: str, answers: Mapping[str, str], edit: str, asks: bool, units: UnitSystem | None
) -> "MachineDraft":
    """Make the draft from the answers in options and at the terminal."""
    from lobewatch.machine.setup_questions.draft import MachineDraft
    from lobewatch.machine.setup_questions.questions import SETUP_QUESTIONS, find_setup_question
    from lobewatch.show.terminal.setup_dialogue import answer_questions, ask_questions

    draft = MachineDraft(text, {})
    draft = draft.set("machine", units=units) if units else draft
    chosen = (find_setup_question(edit),) if edit else SETUP_QUESTIONS
    if edit and not asks and edit not in answers:
        raise ValueError(f"--edit {edit} asks at a terminal, and there is none. Give the answer with --{edit} too.")
    try:
        with shown_units(draft.table("machine").get("units", "metric")):
            return ask_questions(draft, chosen, answers) if asks else answer_questions(draft, answers)
    except (EOFError, KeyboardInterrupt):
        notes.print("\nno file was written")
        raise KeyboardInterrupt from None
