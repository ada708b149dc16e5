"""Ask the questions of `lobewatch init` in the terminal."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from acquisition.errors import join_sentences
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.settings.display_units import LENGTH, UnitSystem, shown_units
from lobewatch.machine.settings.toml import KeyConflict
from lobewatch.machine.setup_questions.draft import MachineDraft, SetupQuestion, find_daqs
from lobewatch.machine.setup_questions.machine_file_changes import change_machine_file
from lobewatch.machine.setup_questions.questions import DAQ_QUESTION, SETUP_QUESTIONS, find_setup_question
from lobewatch.show.terminal.output import notes


def change_settings(
    machine: Path, answers: Mapping[str, str], edit: str, asks: bool, units: UnitSystem | None
) -> MachineDraft:
    """Write the answers to one question to machine.toml. If a key has changed meanwhile, ask or refuse."""
    folder = MachineFolder(machine)
    with folder.locked():  # a running tap test is named before the question
        seen = folder.toml_text
    draft = answer_settings(seen, answers, edit, asks, units)
    change_machine_file(machine, draft.repeat_edits, seen, lambda conflicts: asks and confirm_overwriting(conflicts))
    return draft


def answer_settings(
    text: str, answers: Mapping[str, str], edit: str, asks: bool, units: UnitSystem | None
) -> MachineDraft:
    """Make the draft of machine.toml from the answers in options and at the terminal."""
    draft = MachineDraft(text, {})
    draft = draft.change(lambda draft: draft.set("machine", units=units)) if units else draft
    chosen = (find_setup_question(edit),) if edit else SETUP_QUESTIONS
    if edit and not asks and edit not in answers:
        raise ValueError(f"--edit {edit} asks at a terminal, and there is none. Give the answer with --{edit} too.")
    try:
        with shown_units(draft.table("machine").get("units", "metric")):
            return ask_questions(draft, chosen, answers) if asks else answer_questions(draft, answers)
    except (EOFError, KeyboardInterrupt):
        notes.print("\nno file was written")
        raise KeyboardInterrupt from None


def answer_questions(draft: MachineDraft, answers: Mapping[str, str]) -> MachineDraft:
    """Answer questions by options; raise ValueError that names the option."""
    for question in SETUP_QUESTIONS:
        if question.name in answers:
            draft = _answer_by_option(draft, question, answers)
            if question is DAQ_QUESTION and draft.daq.problem:
                _print_notes(f"note: {draft.daq.problem}")
    if draft.missing_sensors:
        finding = f"--{draft.missing_sensors[0]} is missing, because the DAQ does not describe its sensors"
        raise ValueError(join_sentences(finding, "Give input, sensitivity and range of the sensor"))
    return draft


def ask_questions(draft: MachineDraft, questions: Sequence[SetupQuestion], answers: Mapping[str, str]) -> MachineDraft:
    """Ask a person the questions that `answers` of options do not cover; raise EOFError without an answer."""
    if questions == SETUP_QUESTIONS:
        _print_notes(
            "Enter keeps the value in [brackets], - skips a question. No file is written before the last answer."
        )
    for question in questions:
        number = SETUP_QUESTIONS.index(question) + 1
        already = question.skip_reason(draft)
        if question.name in answers:
            draft = _answer_by_option(draft, question, answers)
        elif already:
            _print_notes(f"\n{number}/{len(SETUP_QUESTIONS)} {question.name}: {already}")
        else:
            draft = _ask(_find_daqs(draft) if question is DAQ_QUESTION else draft, question, number)
    return draft


def _answer_by_option(draft: MachineDraft, question: SetupQuestion, answers: Mapping[str, str]) -> MachineDraft:
    try:
        return draft.answer(question, answers[question.name])
    except ValueError as error:
        raise ValueError(f"--{question.name} {error}") from error


def _ask(draft: MachineDraft, question: SetupQuestion, number: int) -> MachineDraft:
    """Ask one question until its answer is valid."""
    _print_notes(f"\n{number}/{len(SETUP_QUESTIONS)} {question.name}: {question.text.format(length=LENGTH.unit)}")
    _print_notes(f"    for example: {question.example}")
    while True:
        current = question.read_current(draft)
        notes.print(f"    [{current}] > " if current else "    > ", end="", markup=False)
        typed = input().strip()
        answer = typed or current
        if not answer:
            _print_notes("    An answer is required")
            continue
        try:
            answered = draft.answer(question, answer)
        except ValueError as error:
            _print_notes(f"    {str(error).removeprefix('machine.toml: ')}")
            continue
        look, kept = answered.daq, "The port is kept. Check the port with lobewatch ports"
        if question is DAQ_QUESTION and (text := join_sentences(look.problem, kept) if look.problem else look.text):
            _print_notes(f"    {text}")
        is_kept = not typed and answered.text == draft.text
        return replace(answered, edits=draft.edits) if is_kept else answered


def confirm_overwriting(conflicts: Sequence[KeyConflict]) -> bool:
    """Ask a person about keys that changed during the questions."""
    _print_notes("\nAnother program or person changed machine.toml meanwhile:")
    for conflict in conflicts:
        _print_notes(f"    {conflict}")
    notes.print("    Write your answer? [y/N] > ", end="", markup=False)
    try:
        return input().strip().casefold() in ("y", "yes")
    except EOFError:
        return False


def _find_daqs(draft: MachineDraft) -> MachineDraft:
    _print_notes("\nSearching for a DAQ on the ports ...")
    looks = find_daqs()
    _print_notes(*(f"    {i}: {look.port}: {look.text}" for i, look in enumerate(looks, 1)))
    if not looks:
        _print_notes("    no DAQ answers on USB. Enter the port of the DAQ, or - to give the port later with --port")
    return replace(draft, detected_daqs={**draft.detected_daqs, **{look.port: look for look in looks}})


def _print_notes(*texts: str) -> None:
    for text in texts:
        notes.print(text, markup=False)
