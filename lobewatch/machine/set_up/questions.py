"""All that `lobewatch init` asks, in its order."""

from lobewatch.machine.set_up.about_cutting import MATERIAL, PROGRAM, TOOL
from lobewatch.machine.set_up.about_machine import DRIVE, MACHINE, SPEEDS
from lobewatch.machine.set_up.about_sensors import ACCELEROMETER, DAQ, FIXING, HAMMER
from lobewatch.machine.set_up.question import SetUpQuestion

QUESTIONS: tuple[SetUpQuestion, ...] = (
    MACHINE,
    SPEEDS,
    DRIVE,
    DAQ,
    HAMMER,
    ACCELEROMETER,
    FIXING,
    TOOL,
    MATERIAL,
    PROGRAM,
)


def find_question(name: str) -> SetUpQuestion:
    """SetUpQuestion of a name; ValueError with all of them for one that there is not."""
    for question in QUESTIONS:
        if question.name == name:
            return question
    raise ValueError(f"--edit {name}: no such question; there are {', '.join(question.name for question in QUESTIONS)}")
