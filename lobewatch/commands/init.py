"""Command `lobewatch init`: create a machine folder."""

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from lobewatch.commands.shared_options import FolderArgument
from lobewatch.show.terminal.output import Json, emit, notes

if TYPE_CHECKING:
    from lobewatch.machine.setup_questions.draft import MachineDraft

Answer = str | None


def init(
    machine: Annotated[Path, FolderArgument(help="The folder to make.")],
    example: Annotated[bool, Option("--example", help="With the surrogate spindle and three programs.")] = False,
    yes: Annotated[bool, Option("--yes", help="Ask nothing: what no option answers stays as it is.")] = False,
    edit: Annotated[str, Option(help="Ask one thing again, by the name of its option: --edit drive.")] = "",
    name: Annotated[Answer, Option(help="Name of the machine.")] = None,
    speeds: Annotated[Answer, Option(help='Lowest and highest spindle speed, rpm: "1000 18000".')] = None,
    drive: Annotated[Answer, Option(help='Power in kW and torque in N m: "15 40".')] = None,
    daq: Annotated[
        Answer, Option(help='Port of the DAQ, driver, rate: "COM3", "COM3 dataq", "COM3 lines 3200".')
    ] = None,
    hammer: Annotated[Answer, Option(help='Input, mV/N, range in V; not of TAPS/1: "0 2.25 5"; or none.')] = None,
    accelerometer: Annotated[Answer, Option(help='Input, mV/g, range in V: "1 10 5".')] = None,
    fixing: Annotated[Answer, Option(help='Mass (g) of the accelerometer, and how it is fixed: "4 wax".')] = None,
    tool: Annotated[
        Answer, Option(help='Teeth, diameter mm, helix deg, length out mm, of what: "4 20 30 80 carbide".')
    ] = None,
    material: Annotated[Answer, Option(help='What is cut: 42CrMo4; or Kt and Kr in N/mm2: "1400 500".')] = None,
    program: Annotated[Answer, Option(help='Speed rpm, depth, radial depth, feed per tooth: "8000 2 20".')] = None,
    as_json: Json = False,
) -> None:
    """Make a machine folder with a commented machine.toml.

    At a terminal it asks; with --yes, and where nobody sits, it takes what options say and leaves the rest to fill in.

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
    if asks or answers or edit:
        draft = _answer_settings(text, answers, edit, asks)
        text, next_step = draft.text, next_step if draft.daq.port else f"{next_step} --port PORT"
    else:
        change = "change what is not as in your shop" if example else "fill it in"
        next_step = f"{change}, then tap with: {next_step} --port PORT"
    write_machine_file(machine, text)
    payload, text = {"machine": str(machine), "machine_toml": str(toml)}, f"{'altered' if edit else 'made'} {toml}"
    emit(payload, as_json, text, f"next: {next_step}")


def _answer_settings(text: str, answers: Mapping[str, str], edit: str, asks: bool) -> "MachineDraft":
    """Make the draft from the answers in options and at the terminal."""
    from lobewatch.machine.setup_questions.draft import MachineDraft
    from lobewatch.machine.setup_questions.questions import SETUP_QUESTIONS, find_setup_question
    from lobewatch.show.terminal.setup_dialogue import answer_questions, ask_questions

    draft = MachineDraft(text, {})
    chosen = (find_setup_question(edit),) if edit else SETUP_QUESTIONS
    if edit and not asks and edit not in answers:
        raise ValueError(f"--edit {edit}: nobody is at the terminal to ask; give the answer with --{edit}")
    if not asks:
        return answer_questions(draft, answers)
    try:
        return ask_questions(draft, chosen, answers)
    except (EOFError, KeyboardInterrupt):
        notes.print("\nnothing is written")
        raise KeyboardInterrupt from None
