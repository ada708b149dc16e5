"""The tap test of Figs. 5 and 6: one mode as the paper measured it, picked by (28) and (29)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import Frf
from dsm import Spindle, mode_shapes
from lobewatch.paper import printed
from lobewatch.paper.comparison import Comparison, NumberGroup, share_text
from lobewatch.paper.emulated_taps import emulated_taps
from modal import Mode, fit_modes, pick_peaks, synthesize

LINES = np.arange(1000.0, 2501.0)
"""Lines of the FRF, 1 Hz apart (Hz)."""
BAND = (1200.0, 2300.0)
"""Band in which the mode of a tap test is looked for (Hz)."""
TESTS = 8
"""Emulated tap tests."""
MODES = 6
"""Modes of the surrogate that are looked at."""


@dataclass(frozen=True, eq=False)
class TapStudy:
    """FRFs and the modes that are read from them."""

    measured: Mode
    """Mode with the paper's frequency, damping ratio and stiffness."""
    frf: Frf
    """FRF of that mode."""
    picked: Mode
    """Mode picked from it."""
    fitted: Mode
    """Mode fitted to it."""
    surrogate_modes: tuple[Mode, ...]
    """Modes of the calibrated surrogate at the tool tip, with the paper's damping ratio."""
    surrogate_frf: Frf
    """FRF of these."""
    surrogate_picked: Mode
    """Mode picked from that."""
    tapped: Frf
    """FRF of one emulated tap test on the surrogate."""
    scatter_picked: tuple[float, float]
    """rms error of zeta and of K picked from emulated tap tests, as shares."""
    scatter_fitted: tuple[float, float]
    """The same of those fitted."""

    @property
    def extremes(self) -> tuple[float, float]:
        """Exact frequencies of the extremes of Re G (Hz): omega_A and omega_B of (28)."""
        zeta = self.measured.damping_ratio
        below, above = np.sqrt([1 - 2 * zeta, 1 + 2 * zeta]) * self.measured.frequency
        return float(below), float(above)

    @property
    def depth(self) -> float:
        """Im G at the natural frequency (m/N): D of (29)."""
        return -1 / (2 * self.measured.damping_ratio * self.measured.stiffness)


def study_tap(spindle: Spindle) -> TapStudy:
    """The paper's mode, and the surrogate with its calibrated bearings."""
    measured = Mode(printed.FREQUENCY, printed.DAMPING_RATIO, printed.STIFFNESS)
    shapes = mode_shapes(spindle, MODES)
    modes = tuple(
        Mode(float(frequency), printed.DAMPING_RATIO, float(stiffness))
        for frequency, stiffness in zip(shapes.frequency, shapes.stiffness_at(0.0), strict=True)
    )
    frf, other = synthesize([measured], LINES), synthesize(modes, LINES)
    taps = list(emulated_taps(modes, TESTS))
    picked, fitted = ([_first(method(tap, BAND)) for tap in taps] for method in (pick_peaks, fit_modes))
    return TapStudy(
        measured,
        frf,
        pick_peaks(frf)[0],
        fit_modes(frf)[0],
        modes,
        other,
        pick_peaks(other)[0],
        taps[0],
        _scatter(picked, modes[0]),
        _scatter(fitted, modes[0]),
    )


def _first(modes: Sequence[Mode]) -> Mode:
    """The mode nearest to the measured frequency."""
    return min(modes, key=lambda mode: abs(mode.frequency - printed.FREQUENCY))


def _scatter(modes: Sequence[Mode], truth: Mode) -> tuple[float, float]:
    """rms error of zeta and of K as shares of the truth."""
    values = np.array([(mode.damping_ratio, mode.stiffness) for mode in modes])
    zeta, stiffness = np.sqrt(np.mean((values / (truth.damping_ratio, truth.stiffness) - 1) ** 2, axis=0))
    return float(zeta), float(stiffness)


def tap_section(study: TapStudy) -> NumberGroup:
    """Numbers of the tap test."""
    below, above = study.extremes
    zeta, stiffness = printed.DAMPING_RATIO, printed.STIFFNESS
    picked, fitted, model = study.picked, study.fitted, study.surrogate_modes[0]
    closed = "closed form; not printed"
    exact = "least squares has no bias"
    halves = "half by (28), half by the f_1 of the peak"
    high = f"zeta^2 ({share_text(zeta**2)}) high for one mode alone, {halves}; the rest: lines 1 Hz apart"
    low = f"5/4 zeta^2 ({share_text(1.25 * zeta**2)}) low for one mode alone; the rest: lines 1 Hz apart"
    other = "the surrogate is fitted to frequencies, not to K"
    tails = (
        f"{share_text(study.surrogate_picked.stiffness / model.stiffness - 1, '+')}: tails of modes 2 to {MODES} too"
    )
    often = f"rms over {TESTS} emulated tap tests of ten hits, against the truth"
    rest = f"{often}: picking takes three lines, 4 Hz apart, for all"
    (zeta_picked, k_picked), (zeta_fitted, k_fitted) = study.scatter_picked, study.scatter_fitted
    return NumberGroup(
        "The tap test: Figs. 5 and 6, eqs. (28) and (29)",
        ("fig-5", "fig-6"),
        (
            Comparison("f_1", "Fig. 5, 6", printed.FREQUENCY, fitted.frequency, "Hz", 6, "the same mode, fitted"),
            Comparison("omega_A", "(28)", None, below, "Hz", 6, closed),
            Comparison("omega_B", "(28)", None, above, "Hz", 6, closed),
            Comparison("zeta, picked", "(28)", zeta, picked.damping_ratio, "-", 5, high),
            Comparison("zeta, fitted", "", zeta, fitted.damping_ratio, "-", 5, exact),
            Comparison("D = Im G(f_1)", "(29)", None, study.depth, "m/N", 5, closed),
            Comparison("K_exp, picked", "(29)", stiffness, picked.stiffness, "N/m", 5, low),
            Comparison("K_exp, fitted", "", stiffness, fitted.stiffness, "N/m", 5, exact),
            Comparison("K of the surrogate's mode 1", "", stiffness, model.stiffness, "N/m", 5, other),
            Comparison("the same, picked", "(29)", None, study.surrogate_picked.stiffness, "N/m", 5, tails),
            Comparison("error of zeta, picked", "(28)", None, 100 * zeta_picked, "%", 2, rest),
            Comparison("error of zeta, fitted", "", None, 100 * zeta_fitted, "%", 2, often),
            Comparison("error of K, picked", "(29)", None, 100 * k_picked, "%", 2, rest),
            Comparison("error of K, fitted", "", None, 100 * k_fitted, "%", 2, often),
        ),
    )
