"""Shaft of Figs. 3 and 7 to 9: frequencies, calibrated bearings, critical speeds, tip stiffness."""

import math
from dataclasses import replace
from importlib import resources
from typing import NamedTuple

import numpy as np

import dsm
from dsm import Calibration, Spindle, Theory, WhirlMap
from dsm.arrays import Floats
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.paper import printed
from lobewatch.paper.comparison import Comparison, NumberGroup, format_share


def surrogate_spindle(bearing_stiffness: float, theory: Theory = "euler-bernoulli") -> Spindle:
    """Return the surrogate (26 segments, fitted to the paper's frequencies) with a bearing stiffness (N/m)."""
    text = resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8")
    machine = parse_machine_file(text)
    spindle = machine.model(machine.tap.tool)
    bearings = [replace(bearing, stiffness=bearing_stiffness) for bearing in spindle.bearings]
    return replace(spindle, bearings=bearings, theory=theory)


STIFFNESS_CURVE_POINTS = 300
"""Points of Fig. 8; chosen, finer than a screen shows."""
WHIRL_SPEEDS_RPM = np.linspace(0.0, 150e3, 61)
"""Speeds of Figs. 7 and 9 (rpm)."""
OPERATING_SPEED_RPM = 24000.0
"""Highest speed of the machine in the example (rpm)."""


class ShaftStudy(NamedTuple):
    """Frequencies and bearings of the surrogate, by one beam theory."""

    rigid: Spindle
    """Shaft on rigid bearings."""
    rigid_frequency: float
    """First natural frequency on rigid bearings (Hz)."""
    printed_frequencies: tuple[float, float]
    """First natural frequency with the two printed bearing stiffnesses, new and old (Hz)."""
    new: Calibration
    """Bearings calibrated to the measured frequency."""
    old: Calibration
    """Bearings calibrated to the frequency after the drop."""
    critical_speeds: tuple[float, float]
    """Critical speed on rigid and on calibrated bearings (rpm)."""
    curve: tuple[Floats, Floats]
    """Bearing stiffness (N/m) and first natural frequency (Hz), shape (n,) each."""
    rigid_whirl: WhirlMap
    """Frequencies over speed on rigid bearings."""
    whirl: WhirlMap
    """Frequencies over speed on calibrated bearings."""
    at_speed: tuple[float, float]
    """Backward and forward whirl on calibrated bearings at `OPERATING_SPEED_RPM`, seen from the housing (Hz)."""


def study_shaft(theory: Theory) -> ShaftStudy:
    """Study the shaft by one beam theory."""
    shaft = surrogate_spindle(printed.BEARING_STIFFNESS, theory)
    rigid = surrogate_spindle(math.inf, theory)
    new = dsm.calibrate(shaft, printed.FREQUENCY)
    highest = float(dsm.natural_frequencies(rigid, 1)[0])
    frequency = np.linspace(0.13, 0.9985, STIFFNESS_CURVE_POINTS) * highest
    turning = dsm.whirl_map(new.spindle, np.array([OPERATING_SPEED_RPM]), 1)
    old = surrogate_spindle(printed.OLD_BEARING_STIFFNESS, theory)
    frequencies = float(dsm.natural_frequencies(shaft, 1)[0]), float(dsm.natural_frequencies(old, 1)[0])
    dropped = dsm.calibrate(new.spindle, printed.OLD_FREQUENCY)
    speeds = dsm.critical_speed(rigid), dsm.critical_speed(new.spindle)
    curve = dsm.stiffness_curve(shaft, frequency), frequency
    rigid_whirl, whirl = (dsm.whirl_map(spindle, WHIRL_SPEEDS_RPM, 1) for spindle in (rigid, new.spindle))
    at_speed = float(turning.backward[0, 0]), float(turning.forward[0, 0])
    return ShaftStudy(rigid, highest, frequencies, new, dropped, speeds, curve, rigid_whirl, whirl, at_speed)


def shaft_sections(plain: ShaftStudy, shear: ShaftStudy) -> tuple[NumberGroup, NumberGroup]:
    """Return the numbers without and with rotation; plain is Euler-Bernoulli, shear Timoshenko theory."""
    at_rest, spinning = tuple(_numbers_at_rest(plain, shear)), tuple(_spinning_numbers(plain, shear))
    return (
        NumberGroup("Model and bearings: Figs. 3 and 8", ("fig-3", "fig-8"), at_rest),
        NumberGroup("Rotating spindle: Figs. 7 and 9", ("fig-7", "fig-9"), spinning),
    )


def _numbers_at_rest(plain: ShaftStudy, shear: ShaftStudy) -> list[Comparison]:
    fitted = "residual of the surrogate fit"
    same = "same number as in the paper. The surrogate's dimensions are fitted to the printed frequencies."
    excess = (plain.rigid_frequency / printed.FREQUENCY - 1) * 100
    unrounded = (printed.RIGID_FREQUENCY / printed.FREQUENCY - 1) * 100
    rounded = f"the paper rounds {unrounded:.1f} %, the rest is the error of the fit"
    theory = "a calibrated bearing stiffness is valid only for the beam theory of its model"
    left = "ratio of the bearing stiffness for 1550 Hz to that for 1722 Hz"
    (new, old), stiff, soft = plain.printed_frequencies, printed.BEARING_STIFFNESS, printed.OLD_BEARING_STIFFNESS
    return [
        Comparison("segments", "Fig. 3", printed.SEGMENTS, len(plain.rigid.segments), "", 2, same),
        Comparison("bearings", "Fig. 3", printed.BEARINGS, len(plain.rigid.bearings), "", 2, same),
        Comparison("f1, rigid bearings", "", printed.RIGID_FREQUENCY, plain.rigid_frequency, "Hz", 6, fitted),
        Comparison("excess over measured f1", "", printed.RIGID_EXCESS, excess, "%", 3, rounded),
        Comparison("f1 at 1.28e9 N/m", "Fig. 8", printed.FREQUENCY, new, "Hz", 6, fitted),
        Comparison("f1 at 7.72e8 N/m", "Fig. 8", printed.OLD_FREQUENCY, old, "Hz", 6, fitted),
        Comparison("each bearing, for 1722 Hz", "Fig. 8", stiff, plain.new.bearing_stiffness, "N/m", 5, fitted),
        Comparison("each bearing, 1722 Hz, shear", "", None, shear.new.bearing_stiffness, "N/m", 5, theory),
        Comparison("each bearing, for 1550 Hz", "Fig. 8", soft, plain.old.bearing_stiffness, "N/m", 5, fitted),
        Comparison("each bearing, 1550 Hz, shear", "", None, shear.old.bearing_stiffness, "N/m", 5, theory),
        Comparison("remaining stiffness", "Fig. 8", round(soft / stiff, 3), plain.old.factor, "-", 3, left),
        Comparison("remaining stiffness, shear", "", None, shear.old.factor, "-", 3, theory),
    ]


def _spinning_numbers(plain: ShaftStudy, shear: ShaftStudy) -> list[Comparison]:
    pairs = (
        ("critical speed, rigid", "Fig. 7", printed.RIGID_CRITICAL_SPEED, 60 * printed.RIGID_FREQUENCY),
        ("critical speed, 1722 Hz", "Fig. 9", printed.CRITICAL_SPEED, 60 * printed.FREQUENCY),
    )
    lifted = "gyroscopic moments raise the forward whirl"
    rows = []
    for i, (name, where, value, exact) in enumerate(pairs):
        off = format_share(value / exact - 1, "+")
        reason = lifted if i else f"{lifted}, but shear and rotary inertia lower f1 more"
        text = (
            f"exact: 60 f1, {exact:.0f} rpm with the paper's f1. The printed speed is {off} off (read from a figure?)."
        )
        rows += [
            Comparison(name, where, value, plain.critical_speeds[i], "rpm", 6, text),
            Comparison(f"{name}, shear", "", None, shear.critical_speeds[i], "rpm", 6, reason),
        ]
    seen = "fixed frame: speed changes f1 in the rotating frame only"
    parted = "fixed frame: effect of speed with rotary inertia"
    turning = f"at {OPERATING_SPEED_RPM:.0f} rpm"
    return [
        *rows,
        Comparison(f"f1 {turning}", "", None, plain.at_speed[1], "Hz", 6, seen),
        Comparison("backward whirl, shear", "", None, shear.at_speed[0], "Hz", 6, parted),
        Comparison("forward whirl, shear", "", None, shear.at_speed[1], "Hz", 6, parted),
    ]


class StiffnessStudy(NamedTuple):
    """Stiffness at the tool tip of the surrogate, new and old."""

    static: tuple[float, float]
    """Exact static stiffness (N/m)."""
    linearized: tuple[float, float]
    """Static stiffness by (30) to (36), linearized at the natural frequency (N/m)."""
    modal: tuple[float, float]
    """Modal stiffness of mode 1 (N/m)."""


def study_stiffness(old: Calibration) -> StiffnessStudy:
    """Study the tip stiffness from the bearings calibrated to the frequency before and after the drop."""
    pair = (old.given, printed.FREQUENCY), (old.spindle, printed.OLD_FREQUENCY)
    before, after = (dsm.static_stiffness(spindle, linearized_at=frequency) for spindle, frequency in pair)
    static = old.static_stiffness_before, old.static_stiffness_after
    return StiffnessStudy(static, (before, after), (old.modal_stiffness_before, old.modal_stiffness_after))


def stiffness_section(study: StiffnessStudy) -> NumberGroup:
    """Return the numbers of the tip stiffness."""
    old = printed.OLD_STIFFNESS
    ratio = round(old / printed.STIFFNESS, 4)
    static, modal = study.linearized[1] / study.linearized[0], study.modal[1] / study.modal[0]
    rounded = "0.9 x 1722, rounded in the paper"
    rule = "equal in every printed digit: K_theo follows from this rule, not from (30) to (36)"
    off = format_share(study.linearized[1] / study.static[1] - 1, "+")
    cost = f"linearised at 1550 Hz, {off} off the exact value, and the surrogate is not the paper's shaft"
    exact = "first term of the power series of the dynamic stiffness in frequency, exact"
    part = "by (30) to (36) at both frequencies: the bearings are only part of the compliance"
    shown = "the modal stiffness, seen in an FRF and needed for lobes, hardly drops"
    numbers = (
        Comparison("f1, old", "", printed.OLD_FREQUENCY, 0.9 * printed.FREQUENCY, "Hz", 5, rounded),
        Comparison("K_theo by the rule 0.9 K_exp", "(36)", old, 0.9 * printed.STIFFNESS, "N/m", 6, rule),
        Comparison("K_theo by (30) to (36)", "(36)", old, study.linearized[1], "N/m", 5, cost),
        Comparison("K static, new", "(35)", None, study.static[0], "N/m", 5, exact),
        Comparison("K static, old", "(35)", None, study.static[1], "N/m", 5, exact),
        Comparison("K static, old over new", "(36)", ratio, static, "-", 4, part),
        Comparison("K of mode 1, old over new", "", ratio, modal, "-", 4, shown),
    )
    return NumberGroup("Tip stiffness of the old spindle: eqs. (30) to (36)", (), numbers)
