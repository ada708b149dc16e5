"""Ask the questions of `lobewatch init` in the terminal."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from acquisition.errors import join_sentences
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.machine.setup_questions.draft import MachineDraft, SetupQuestion, find_daqs
from lobewatch.machine.setup_questions.questions import DAQ_QUESTION, SETUP_QUESTIONS
from lobewatch.show.terminal.output import notes


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
        return question.apply_answer(draft, answers[question.name]).checked()
    except ValueError as error:
        raise ValueError(f"--{question.name} {error}") from error


def _ask(draft: MachineDraft, question: SetupQuestion, number: int) -> MachineDraft:
    """Ask one question until its answer is valid."""
    _print_notes(f"\n{number}/{len(SETUP_QUESTIONS)} {question.name}: {question.text.format(length=LENGTH.unit)}")
    _print_notes(f"    for example: {question.example}")
    while True:
        current = question.read_current(draft)
        notes.print(f"    [{current}] > " if current else "    > ", end="", markup=False)
        answer = input().strip() or current
        if not answer:
            _print_notes("    An answer is required")
            continue
        try:
            answered = question.apply_answer(draft, answer).checked()
        except ValueError as error:
            _print_notes(f"    {str(error).removeprefix('machine.toml: ')}")
            continue
        look, kept = answered.daq, "The port is kept. Check the port with lobewatch ports"
        if question is DAQ_QUESTION and (text := join_sentences(look.problem, kept) if look.problem else look.text):
            _print_notes(f"    {text}")
        return answered


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
