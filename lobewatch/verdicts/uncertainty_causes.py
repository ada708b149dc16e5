"""Causes of uncertainty with their names, labels and remedies."""

from typing import NamedTuple

from lobewatch.tool.tap_series import MIN_TAPS_FOR_SCATTER


class Cause(NamedTuple):
    """A cause of uncertainty with its texts, templates for `program_remarks.uncertainty_advice`."""

    name: str
    """Name in `Uncertainty.causes`, `find_decisive_cause` and JSON."""
    sentence: str
    """Sentence where it is the decisive cause of a doubtful verdict."""
    remedy: str
    """Remedy that reduces it."""
    label: str = ""
    """Label of the half-widths of modes that it causes; empty for a cause that has none."""


TAP_TEST = Cause("tap", "result depends on the tap test error", "Tap again with more hits", label="from the tap test")
CLAMPING = Cause(
    "clamping",
    "result depends on the scatter between tap tests",
    f"Tap again until {MIN_TAPS_FOR_SCATTER} tests give the scatter of this tool",
    label="between tap tests",
)
PREDICTION = Cause(
    "prediction", "result depends on the prediction by the model", "Tap tool {tool}", label="from the prediction"
)
UNTAPPED = Cause("untapped", "{missing}", "{missing_remedy}", label="in {direction}, not {lacking}")
TEST_CUTS = Cause(
    "cuts",
    "result depends on the spindle at speed (test cuts so far: {n_cuts})",
    "Make the next test cut for {program} with program_learning.find_next_cut",
    label="after the test cuts",
)
CROSS = Cause("cross", "result depends on the principal directions of the modes", "Tap Circumstances.direction xy")
SPEED = Cause("speed", "result depends on the exact spindle speed", "Choose a speed in the middle of a stable pocket")
COEFFICIENTS = Cause(
    "coefficients",
    "result depends on the cutting-force coefficients (chatter above Kt {kt} N/mm2)",
    "{coefficients_remedy}",
)
WEAR = Cause("wear", "result depends on tool wear (chatter above Kt {kt} N/mm2)", 'Use new edges and set wear = "new"')
SPEED_DROP = Cause(
    "drop",
    "stable not rotating, but chatter within the frequency drop at speed of {drop_percent} %",
    "Make test cuts for {program} with program_learning.find_next_cut, or set drop_percent in [speed]",
)
QUESTION = Cause("question", "a tap test has an open question ({questions})", "Answer the question, or tap again")
COVERAGE = Cause("coverage", "the modes do not cover the measurement ({uncovered})", "{uncovered_remedy}")
UNCHECKED = Cause("unchecked", "{unchecked}", "{unchecked_remedy}")
NO_TAP_TEST = Cause(
    "no-tap-test",
    "no tap test yet, and no test cut at this speed decides",
    "Tap tool {tool}, or make test cuts for {program} with cut_recording.acquire_cut",
)
WORKPIECE = Cause(
    "workpiece",
    "the thin wall deflects and its modes are unknown",
    "Support the wall and remove thin = true, or find the depth with test cuts",
)

UNCERTAINTY_CAUSES = {cause.name: cause for cause in tuple(globals().values()) if isinstance(cause, Cause)}
"""All causes by name; an unknown name is a KeyError."""
