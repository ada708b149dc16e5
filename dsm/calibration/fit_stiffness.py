"""Fit several bearing and joint stiffnesses to several measured natural frequencies."""

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike

from dsm.arrays import Floats
from dsm.calibration.calibration import UnreachableFrequencyError
from dsm.calibration.fit_result import StiffnessFit, StiffnessFitError
from dsm.calibration.identifiability import IDENTIFIABILITY_REMEDY, ProfileScan, identifiability_remarks, scan_rivals
from dsm.calibration.least_squares import MAX_LOG_FACTOR, Iterate, StiffnessProblem, check_measured_modes, minimize
from dsm.calibration.report_text import FitRemark
from dsm.calibration.stiffness_groups import chosen_groups, scale_groups
from dsm.modes.natural_frequencies import natural_frequencies
from dsm.spindle.spindle import Spindle, require_support

EXTRA_STARTS = 8
"""Further starts, about a factor of e around the given one, if that leads to no minimum or to a poor one."""
BACKTRACK_SHARES = (0.0, 0.1, 0.2, 0.4, 0.7, 1.0)
"""Shares of the way to a runaway value that are tried for a stiffness without effect."""
MAX_CONDITION_NUMBER = 30.0
"""Largest condition number that is not reported."""
CLOSE_MODE_SHARE = 0.01
"""Largest relative distance of close modes, which are reported."""


def fit_stiffness(
    spindle: Spindle | Sequence[Spindle],
    frequency: ArrayLike,
    frequency_std: ArrayLike | None = None,
    mode: Sequence[int] | None = None,
    groups: Sequence[str] | None = None,
    shaft: Sequence[int] | None = None,
    start: Sequence[float] | None = None,
    tolerance: float = 0.0,
) -> StiffnessFit:
    """Scale each group of bearings and joints by its own factor, so that modes have their measured frequencies.

    A bearing keeps its stiffness against tilting and that of its housing; a joint has both stiffnesses scaled,
    or each separately (`Joint.rotational_group`). `calibrate` solves one group and one mode without iteration.

    Least squares in the logarithms of the factors by Levenberg and Marquardt, with d ln f / d ln factor = half the
    group's share of the strain energy. Modes keep their number, never their shape: every step solves for certified
    modes, and two close modes (veering) exchange shapes while their numbers stay. Veering makes local minima:
    if the given stiffnesses lead to no fit, a few starts around them are tried and the best is kept. Of
    several solutions that fit, such as the two of a symmetric shaft, the first one is returned, unless another fits
    better by more than 95 % intervals allow; a remark names the others.

    Remarks tell if the frequencies leave a stiffness open (identifiability), if modes do not separate the
    groups, lie close together, or do not fit. Without remarks the 95 % intervals hold.

    Parameters
    ----------
    spindle : Spindle or sequence of Spindle
        One spindle, or several with the same bearings and joints, such as one with two tools: a group has the
        same factor in all of them.
    frequency : array_like, shape (n,)
        Measured frequencies (Hz).
    frequency_std : array_like, shape (n,), optional
        Standard errors (Hz), the weights. Default: equal relative errors.
    mode : sequence of int, shape (n,), optional
        Numbers of the modes, 1 is the lowest. Default: 1 to n.
    groups : sequence of str, optional
        Groups of bearings and joints, no more than n. Default: all.
    shaft : sequence of int, shape (n,), optional
        Spindle of each measurement, 0 is the first. Default: the first.
    start : sequence of float, shape (g,), optional
        Only start factors (-). Default: 1, and others if that leads to no fit.
    tolerance : float
        Relative standard error of each diameter of the drawing (-), used with frequency_std.

    Returns
    -------
    StiffnessFit
        Fitted spindles with factors, errors and remarks.

    Raises
    ------
    ValueError
        For bad frequencies and groups.
    UnreachableFrequencyError
        If no factor from 1e-6 to 1e6 gives a mode its frequency.
    StiffnessFitError
        If no minimum is found; it holds the best estimate.

    Examples
    --------
    Front and rear bearings that have worn differently, from three modes:

    >>> shaft = [Segment(0.12, 0.03), Segment(0.2, 0.07), Segment(0.15, 0.05)]
    >>> new = Spindle(shaft, [Bearing(0.15, 2.5e8, group="front"), Bearing(0.4, 2.5e8, group="rear")])
    >>> worn = Spindle(shaft, [Bearing(0.15, 1.5e8), Bearing(0.4, 2e8)])
    >>> fit = fit_stiffness(new, natural_frequencies(worn, 3), frequency_std=[1.0, 1.0, 1.0])
    >>> fit.groups, fit.factor.round(4).tolist(), fit.remarks
    (('front', 'rear'), [0.6, 0.8], ())
    >>> [format_with_error(k, std, 1e6, "N/um") for k, std in zip(fit.stiffness, fit.stiffness_std, strict=True)]
    ['150.00 ± 0.41 N/um', '200.00 ± 0.46 N/um']
    """
    spindles = (spindle,) if isinstance(spindle, Spindle) else tuple(spindle)
    for model in spindles:
        require_support(model)
    names = chosen_groups(spindles, groups)
    measured = check_measured_modes(len(spindles), frequency, frequency_std, mode, shaft)
    if measured.frequency.size < len(names):
        raise ValueError(
            f"{measured.frequency.size} measured mode(s) are not enough for the stiffness of {len(names)} groups "
            f"({', '.join(names)}). Measure more modes, or calibrate fewer groups."
        )
    problem = StiffnessProblem(spindles, names, measured)
    state, found = _search(problem, None if start is None else np.log(start))
    if tolerance > 0 and measured.std is not None:
        problem = problem.with_drawing(state, tolerance)
        state, found = _search(problem, state.log_factor)
    state, around = scan_rivals(problem, state) if found else (state, None)
    if not (found and problem.fits(state)):
        with suppress(ArithmeticError):  # factors so far apart may be beyond what can be computed
            _require_reachable(problem)
    result = _build_result(problem, state, around, tolerance)
    if not found:
        raise StiffnessFitError(_failure_text(result), result)
    return result


def _search(problem: StiffnessProblem, begin: Floats | None) -> tuple[Iterate, bool]:
    """Return the best state, and whether it is a minimum, from the given start or from others if that is poor."""
    size = len(problem.names)
    state, found = minimize(problem, np.zeros(size) if begin is None else begin)
    if not found:
        state, found = _restore_unfelt(problem, state)
    for start in np.random.default_rng(0).normal(size=(EXTRA_STARTS, size)):
        if begin is not None or (found and problem.fits(state)):
            break
        other, other_found = minimize(problem, start)
        if (other_found, -other.cost) > (found, -state.cost):
            state, found = other, other_found
    return state, found


def _restore_unfelt(problem: StiffnessProblem, state: Iterate) -> tuple[Iterate, bool]:
    """Fit with the factors without effect at their given values, or as near as the frequencies allow.

    Such factors run away, to the end of the range or to where rounding ends the search. Returns the state and False
    if there are none, or nothing fits.
    """
    away = np.flatnonzero(state.unfelt)
    if away.size == 0:
        return state, False
    for part in BACKTRACK_SHARES:
        start = state.log_factor.copy()
        start[away] *= part
        other, found = minimize(problem, start, away.tolist())
        if found and problem.fits(other):
            return other, True
    return state, False


def _build_result(problem: StiffnessProblem, state: Iterate, around: ProfileScan | None, tol: float) -> StiffnessFit:
    measured = problem.measured
    unsure = identifiability_remarks(problem, state, around)
    checks = _collinear_group_remarks, _close_mode_remarks, _misfit_remarks
    return StiffnessFit(
        groups=problem.names,
        mode=measured.mode,
        frequency=measured.frequency,
        frequency_std=measured.std,
        fitted_frequency=state.fitted,
        factor=np.exp(state.log_factor),
        log_covariance=problem.covariance(state),
        energy_share=state.share,
        remarks=(*unsure, *(remark for check in checks for remark in check(problem, state))),
        shaft=measured.shaft,
        given=problem.spindles,
        spindles=state.spindles,
        chi_square=None if measured.std is None else state.cost,
        tolerance=tol,
    )


def _collinear_group_remarks(problem: StiffnessProblem, state: Iterate) -> list[FitRemark]:
    """Return a remark on groups that change the frequencies in the same ratio."""
    if np.any(state.unfelt):
        return []
    ratio = state.share / np.linalg.norm(state.share, axis=0)
    condition = float(np.linalg.cond(ratio))
    if condition <= MAX_CONDITION_NUMBER:
        return []
    weakest = np.abs(np.linalg.svd(ratio)[2][-1])
    mixed = ", ".join(name for name, part in zip(problem.names, weakest, strict=True) if part > 0.3)
    text = f"the measured modes hardly separate the stiffnesses of these groups (condition number {condition:.2g})"
    return [FitRemark("groups-alike", mixed, text, IDENTIFIABILITY_REMEDY)]


def _close_mode_remarks(problem: StiffnessProblem, state: Iterate) -> list[FitRemark]:
    """Return remarks on pairs of close modes with a measured one among them."""
    measured = problem.measured
    remarks = []
    for number, frequency in enumerate(state.frequency):
        gap, numbers = np.diff(frequency) / frequency[1:], measured.mode[measured.shaft == number]
        where = f" of spindle {number + 1}" if len(state.frequency) > 1 else ""
        for low in range(1, frequency.size):
            if gap[low - 1] < CLOSE_MODE_SHARE and np.any((numbers == low) | (numbers == low + 1)):
                text = f"only {100 * gap[low - 1]:.2g} % apart in the fitted model, so their shapes mix "
                text += "and the standard errors hold only for small changes"
                pair, cure = f"modes {low} and {low + 1}{where}", "Check which of the two modes was measured"
                remarks.append(FitRemark("modes-exchange-shapes", pair, text, cure))
    return remarks


def _misfit_remarks(problem: StiffnessProblem, state: Iterate) -> list[FitRemark]:
    if problem.fits(state):
        return []
    worst = float(np.max(np.abs(state.fitted / problem.measured.frequency - 1)))
    text = f"the fitted frequencies are off by up to {100 * worst:.2g} %, more than the standard errors explain"
    return [FitRemark("frequencies-misfit", "", text, "Check geometry of the model, mode numbers and standard errors")]


def _require_reachable(problem: StiffnessProblem) -> None:
    """Raise UnreachableFrequencyError for a mode measured outside the range of the factors; all raise all modes."""
    measured, names = problem.measured, problem.names
    ends = np.empty((2, measured.mode.size))
    for number, spindle in enumerate(problem.spindles):
        here = measured.shaft == number
        for row, end in enumerate((-MAX_LOG_FACTOR, MAX_LOG_FACTOR)):
            scaled = scale_groups(spindle, dict.fromkeys(names, math.exp(end)))
            ends[row, here] = natural_frequencies(scaled, int(np.max(measured.mode[here])))[measured.mode[here] - 1]
    for mode, frequency, low, high in zip(measured.mode, measured.frequency, *ends.tolist(), strict=True):
        if not low < frequency < high:
            raise UnreachableFrequencyError(
                f"no stiffness of {', '.join(names)} gives mode {mode} at {frequency:g} Hz, only {low:.1f} to "
                f"{high:.1f} Hz. Check the geometry of the model and the mode number.",
                (low, high),
            )


def _failure_text(result: StiffnessFit) -> str:
    factors = ", ".join(f"{name} {factor:.3g}" for name, factor in zip(result.groups, result.factor, strict=True))
    residual = float(np.max(np.abs(result.residual)))
    return (
        f"no stiffness fits these frequencies: the best factors ({factors}) leave a residual of {residual:.3g} Hz. "
        "Check the mode numbers, start from other stiffnesses, or calibrate fewer groups."
    )
