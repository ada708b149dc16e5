"""Tap test of Figs. 5 and 6: the mode of the paper, peak picking by (28) and (29), emulated hits."""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

import acquisition
from acquisition import Channel, Frf, HammeredStructure, Hammering, SimulatedSource, Structure, Trigger
from dsm import Spindle, mode_shapes
from lobewatch.paper import printed
from lobewatch.paper.comparison import Comparison, NumberGroup, format_share
from modal import Mode, fit_modes, pick_peaks, synthesize_frf

EMULATED_TAP_RATE = 25600.0
"""Sample rate (Hz)."""
EMULATED_TAP_CHANNELS = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)
"""Hammer and accelerometer of the demo."""
EMULATED_TAP_TRIGGER = Trigger(level=20.0, n_samples=6400, pre_trigger=512)
"""Trigger with records of 0.25 s."""
EMULATED_TAP_SECONDS = 10.0
"""Time for ten good hits (s)."""


def emulate_taps(modes: Sequence[Mode], tests: int, hits: int = 10) -> Iterator[Frf]:
    """Yield the FRF of each of several tap tests, each with its own random numbers."""
    structure = Structure(*np.array([(mode.frequency, mode.damping_ratio, mode.stiffness) for mode in modes]).T)
    for seed in range(tests):
        signal = HammeredStructure(structure, EMULATED_TAP_RATE, np.random.default_rng(seed), Hammering())
        n_samples = int(EMULATED_TAP_SECONDS * EMULATED_TAP_RATE)
        source = SimulatedSource(signal, EMULATED_TAP_CHANNELS, EMULATED_TAP_RATE, n_samples)
        source.start()
        good = (hit for hit in acquisition.capture_hits(source, EMULATED_TAP_TRIGGER) if not acquisition.check_hit(hit))
        yield acquisition.estimate_frf(list(islice(good, hits)))


TAP_FREQUENCY_LINES = np.arange(1000.0, 2501.0)
"""Lines of the FRF, 1 Hz apart (Hz)."""
TAP_BAND = (1200.0, 2300.0)
"""Band of the mode of a tap test (Hz)."""
EMULATED_TESTS = 8
"""Number of emulated tap tests."""
SURROGATE_MODES = 6
"""Number of modes of the surrogate."""


class TapStudy(NamedTuple):
    """FRFs and the modes identified from them."""

    measured: Mode
    """Mode with the paper's frequency, damping ratio and stiffness."""
    frf: Frf
    """FRF of that mode."""
    picked: Mode
    """Mode picked from that FRF."""
    fitted: Mode
    """Mode fitted to that FRF."""
    surrogate_modes: tuple[Mode, ...]
    """Modes of the calibrated surrogate at the tool tip, with the paper's damping ratio."""
    surrogate_frf: Frf
    """FRF of the surrogate modes."""
    surrogate_picked: Mode
    """Mode picked from the FRF of the surrogate."""
    tapped: Frf
    """FRF of one emulated tap test on the surrogate."""
    scatter_picked: tuple[float, float]
    """Relative rms error of zeta and of K picked from emulated tap tests."""
    scatter_fitted: tuple[float, float]
    """Relative rms error of zeta and of K fitted to emulated tap tests."""

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
    """Identify the paper's mode, and those of the surrogate with its calibrated bearings."""
    measured = Mode(printed.FREQUENCY, printed.DAMPING_RATIO, printed.STIFFNESS)
    shapes = mode_shapes(spindle, SURROGATE_MODES)
    modes = tuple(
        Mode(float(frequency), printed.DAMPING_RATIO, float(stiffness))
        for frequency, stiffness in zip(shapes.frequency, shapes.stiffness_at(0.0), strict=True)
    )
    frf, other = synthesize_frf([measured], TAP_FREQUENCY_LINES), synthesize_frf(modes, TAP_FREQUENCY_LINES)
    taps = list(emulate_taps(modes, EMULATED_TESTS))
    picked, fitted = ([_nearest_mode(method(tap, TAP_BAND)) for tap in taps] for method in (pick_peaks, fit_modes))
    scatter = _relative_scatter(picked, modes[0]), _relative_scatter(fitted, modes[0])
    of_paper = measured, frf, pick_peaks(frf)[0], fit_modes(frf)[0]
    return TapStudy(*of_paper, modes, other, pick_peaks(other)[0], taps[0], *scatter)


def _nearest_mode(modes: Sequence[Mode]) -> Mode:
    return min(modes, key=lambda mode: abs(mode.frequency - printed.FREQUENCY))


def _relative_scatter(modes: Sequence[Mode], truth: Mode) -> tuple[float, float]:
    """Return the relative rms error of zeta and of K."""
    values = np.array([(mode.damping_ratio, mode.stiffness) for mode in modes])
    zeta, stiffness = np.sqrt(np.mean((values / (truth.damping_ratio, truth.stiffness) - 1) ** 2, axis=0))
    return float(zeta), float(stiffness)


def tap_section(study: TapStudy) -> NumberGroup:
    """Return the numbers of the tap test."""
    below, above = study.extremes
    zeta, stiffness = printed.DAMPING_RATIO, printed.STIFFNESS
    picked, fitted, model = study.picked, study.fitted, study.surrogate_modes[0]
    closed = "closed form, not printed"
    exact = "least-squares fit without bias"
    halves = "half from eq. (28), half from the f1 of the peak"
    rest = "The rest comes from frequency lines 1 Hz apart."
    high = f"zeta^2 ({format_share(zeta**2)}) too high for a single mode, {halves}. {rest}"
    low = f"5/4 zeta^2 ({format_share(1.25 * zeta**2)}) too low for a single mode. {rest}"
    other = "surrogate fitted to frequencies, not to K"
    shift = format_share(study.surrogate_picked.stiffness / model.stiffness - 1, "+")
    tails = f"{shift}, also from the tails of modes 2 to {SURROGATE_MODES}"
    often = f"rms over {EMULATED_TESTS} emulated tap tests of ten hits, compared with the true value"
    rest = f"{often} (picking uses only three lines, 4 Hz apart)"
    (zeta_picked, k_picked), (zeta_fitted, k_fitted) = study.scatter_picked, study.scatter_fitted
    numbers = (
        Comparison("f1", "Fig. 5, 6", printed.FREQUENCY, fitted.frequency, "Hz", 6, "same mode, fitted"),
        Comparison("omega_A", "(28)", None, below, "Hz", 6, closed),
        Comparison("omega_B", "(28)", None, above, "Hz", 6, closed),
        Comparison("zeta, picked", "(28)", zeta, picked.damping_ratio, "-", 5, high),
        Comparison("zeta, fitted", "", zeta, fitted.damping_ratio, "-", 5, exact),
        Comparison("D = Im G(f1)", "(29)", None, study.depth, "m/N", 5, closed),
        Comparison("K_exp, picked", "(29)", stiffness, picked.stiffness, "N/m", 5, low),
        Comparison("K_exp, fitted", "", stiffness, fitted.stiffness, "N/m", 5, exact),
        Comparison("K of the surrogate's mode 1", "", stiffness, model.stiffness, "N/m", 5, other),
        Comparison("K of that mode, picked", "(29)", None, study.surrogate_picked.stiffness, "N/m", 5, tails),
        Comparison("error of zeta, picked", "(28)", None, 100 * zeta_picked, "%", 2, rest),
        Comparison("error of zeta, fitted", "", None, 100 * zeta_fitted, "%", 2, often),
        Comparison("error of K, picked", "(29)", None, 100 * k_picked, "%", 2, rest),
        Comparison("error of K, fitted", "", None, 100 * k_fitted, "%", 2, often),
    )
    return NumberGroup("The tap test: Figs. 5 and 6, eqs. (28) and (29)", ("fig-5", "fig-6"), numbers)
