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


TAP_TEST = Cause("tap", "the error of the tap test decides", "tap again with more hits", label="by the tap test")
CLAMPING = Cause(
    "clamping",
    "the scatter from tap test to tap test decides",
    f"tap again: from {MIN_TAPS_FOR_SCATTER} tests on the scatter of this very tool counts",
    label="from tap to tap",
)
PREDICTION = Cause("prediction", "the prediction decides", "tap tool {tool}", label="by the prediction")
UNTAPPED = Cause("untapped", "{missing}", "{missing_remedy}", label="in {direction}, not {lacking}")
TEST_CUTS = Cause(
    "cuts",
    "the spindle at speed decides, as {n_cuts} test cuts have left it open",
    "make the next test cut: program_learning.find_next_cut names it for {program}",
    label="left open by test cuts",
)
CROSS = Cause(
    "cross", "the axes of the modes decide, which taps in x and in y leave open", "tap Circumstances.direction xy"
)
SPEED = Cause("speed", "the spindle speed decides", "run it in the middle of a window of speeds")
COEFFICIENTS = Cause(
    "coefficients", "the cutting coefficients decide: chatters above Kt {kt} N/mm2", "{coefficients_remedy}"
)
WEAR = Cause("wear", "wear decides: chatters above Kt {kt} N/mm2", 'run it with new edges and write wear = "new"')
QUESTION = Cause("question", "it rests on a tap test in question ({questions})", "answer the question, or tap again")
WORKPIECE = Cause(
    "workpiece",
    "the wall that is cut is thin: it gives way, and its modes are not known",
    "support it and take thin = true out, or find the depth by test cuts",
)

UNCERTAINTY_CAUSES = {cause.name: cause for cause in tuple(globals().values()) if isinstance(cause, Cause)}
"""All causes by name; an unknown name is a KeyError."""
