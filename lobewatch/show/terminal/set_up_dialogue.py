"""The ten questions of `lobewatch init`, put to a person at the terminal or answered by options."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from lobewatch.machine.set_up.about_sensors import DAQ
from lobewatch.machine.set_up.daq_look import DaqLook, find_daqs
from lobewatch.machine.set_up.draft import Draft
from lobewatch.machine.set_up.question import SetUpQuestion
from lobewatch.machine.set_up.questions import QUESTIONS
from lobewatch.show.terminal.output import notes


def answer_questions(draft: Draft, answers: Mapping[str, str]) -> Draft:
    """A draft with the answers of options, by the names of the questions; ValueError that names the option."""
    for question in QUESTIONS:
        if question.name in answers:
            draft = _by_option(draft, question, answers)
            if question is DAQ and draft.daq.problem:
                _say(f"note: {draft.daq.problem}")
    if draft.lacks_sensors:
        raise ValueError(
            f"--{draft.lacks_sensors[0]}: missing; a {draft.daq.driver} DAQ does not know its sensors: "
            "give their input, sensitivity and range"
        )
    return draft


def ask_questions(draft: Draft, questions: Sequence[SetUpQuestion], answers: Mapping[str, str]) -> Draft:
    """A draft with what a person answers to each question; answers: those of options, which are not asked.

    EOFError where nobody answers any more.
    """
    if questions == QUESTIONS:
        _say("Enter takes what stands in [brackets], - leaves something open; nothing is written before the end.")
    for question in questions:
        number = QUESTIONS.index(question) + 1
        already = question.already(draft)
        if question.name in answers:
            draft = _by_option(draft, question, answers)
        elif already:
            _say(f"\n{number}/{len(QUESTIONS)} {question.name}: {already}")
        else:
            draft = _ask(_with_daqs(draft) if question is DAQ else draft, question, number)
    return draft


def _by_option(draft: Draft, question: SetUpQuestion, answers: Mapping[str, str]) -> Draft:
    try:
        return question.answer(draft, answers[question.name]).checked()
    except ValueError as error:
        raise ValueError(f"--{question.name} {error}") from error


def _ask(draft: Draft, question: SetUpQuestion, number: int) -> Draft:
    """Put one question until its answer is one."""
    _say(f"\n{number}/{len(QUESTIONS)} {question.name}: {question.words}", f"    for example: {question.example}")
    while True:
        current = question.current(draft)
        notes.print(f"    [{current}] > " if current else "    > ", end="", markup=False)
        answer = input().strip() or current
        if not answer:
            _say("    this is needed")
            continue
        try:
            answered = question.answer(draft, answer).checked()
        except ValueError as error:
            _say(f"    {_without_place(error)}")
            continue
        _say(*(f"    {text}" for text in _about_daq(answered) if question is DAQ))
        return answered


def _with_daqs(draft: Draft) -> Draft:
    _say("\nLooking for a DAQ on the ports ...")
    looks = find_daqs()
    _say(*(f"    {i}: {look.port}: {look.text}" for i, look in enumerate(looks, 1)))
    if not looks:
        _say("    none answers on a USB port; name its port, or - and give it later with --port")
    return replace(draft, looks={**draft.looks, **{look.port: look for look in looks}})


def _about_daq(draft: Draft) -> list[str]:
    look: DaqLook = draft.daq
    if look.problem:
        return [f"{look.problem}; the port is kept: lobewatch ports looks again"]
    return [f"{look.text}"] if look.text else []


def _without_place(error: ValueError) -> str:
    return str(error).removeprefix("machine.toml: ")


def _say(*texts: str) -> None:
    for text in texts:
        notes.print(text, markup=False)
