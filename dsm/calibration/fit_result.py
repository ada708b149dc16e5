"""Result of a stiffness fit, and the prediction of further modes from it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dsm.arrays import Floats, Indices
from dsm.calibration.least_squares import (
    MAX_LOG_INTERVAL,
    diameter_columns,
    diameter_effects,
    diameter_keys,
    frequency_effects,
)
from dsm.calibration.report_text import FitRemark, format_with_error
from dsm.calibration.stiffness_groups import group_stiffness, is_tilting, scale_groups
from dsm.modes.natural_frequencies import modes_at
from dsm.spindle.spindle import Spindle

OPEN_REMARK_CODES = ("group-not-felt", "stiffness-ambiguous")
"""Codes of remarks that leave a stiffness open."""


@dataclass(frozen=True, eq=False)
class StiffnessFit:
    """Spindles whose groups of bearings and joints, each scaled by a factor, put modes at measured frequencies.

    n modes, g groups, one spindle or several that share them. Standard errors are of first order in those of the
    frequencies. They hold for the logarithm of a factor too: an error of 10 % is 0.1 there. str() gives a report.
    """

    groups: tuple[str, ...]
    """Names of the groups."""
    mode: Indices
    """Numbers of the measured modes, shape (n,); 1 is the lowest."""
    frequency: Floats
    """Measured frequencies (Hz), shape (n,)."""
    frequency_std: Floats | None
    """Standard errors of the frequencies (Hz), shape (n,); None if not given."""
    fitted_frequency: Floats
    """Frequencies of the fitted spindle (Hz), shape (n,)."""
    factor: Floats
    """Stiffness after over before (-), shape (g,)."""
    log_covariance: Floats | None
    """Covariance of the logarithms of the factors (-), shape (g, g); None without errors and without spare modes.

    Propagated from the standard errors of the frequencies, whatever the residuals are. Without them, from
    the scatter of the residuals, as equal relative errors of the frequencies.
    """
    energy_share: Floats
    """Share of each group in the strain energy of each mode (-), shape (n, g); twice d ln f / d ln factor."""
    remarks: tuple[FitRemark, ...]
    """Remarks on doubtful results, and remedies."""
    shaft: Indices
    """Number of the spindle of each mode, shape (n,); 0 is the first."""
    given: tuple[Spindle, ...]
    """Spindles as given."""
    spindles: tuple[Spindle, ...]
    """Fitted spindles."""
    chi_square: float | None
    """Sum of squared residuals over their errors, those of the drawing included (-); None without errors."""
    tolerance: float
    """Relative standard error of each diameter of the drawing (-)."""

    @property
    def spindle(self) -> Spindle:
        """Fitted spindle, the first of several."""
        return self.spindles[0]

    def apply_to(self, spindle: Spindle) -> Spindle:
        """Scale the groups of a spindle by the fitted factors.

        Parameters
        ----------
        spindle : Spindle
            Spindle with the stiffnesses that the fit started from.

        Returns
        -------
        Spindle
            Scaled spindle.
        """
        return scale_groups(spindle, dict(zip(self.groups, self.factor.tolist(), strict=True)))

    @property
    def open_groups(self) -> frozenset[str]:
        """Groups whose stiffness the measured modes leave open, by the remarks."""
        about = [remark.about for remark in self.remarks if remark.code in OPEN_REMARK_CODES]
        return frozenset(name for entry in about for name in ([entry] if entry in self.groups else self.groups))

    @property
    def has_misfit(self) -> bool:
        """True if the frequencies contradict one another far beyond their errors."""
        return any(remark.code == "frequencies-misfit" for remark in self.remarks)

    @property
    def residual(self) -> Floats:
        """Fitted less measured frequency (Hz), shape (n,)."""
        return np.asarray(self.fitted_frequency - self.frequency)

    @property
    def factor_std(self) -> Floats | None:
        """Standard errors of the factors (-), shape (g,); None without a covariance."""
        if self.log_covariance is None:
            return None
        return np.asarray(self.factor * np.sqrt(np.diag(self.log_covariance)))

    @property
    def stiffness(self) -> Floats:
        """Mean radial stiffness of each group after the fit (N/m), shape (g,).

        For a group of stiffnesses against tilting only it is their mean (N m/rad). An equivalent number of this model:
        compare it only with others of the same geometry and beam theory.
        """
        return np.array([group_stiffness(self.spindles, group) for group in self.groups])

    @property
    def stiffness_std(self) -> Floats | None:
        """Standard error of the stiffness (N/m), shape (g,); None without a covariance."""
        std = self.factor_std
        return None if std is None else np.asarray(self.stiffness * std / self.factor)

    @property
    def correlation(self) -> Floats | None:
        """Correlations of the factors (-), shape (g, g); None without a covariance."""
        if self.log_covariance is None:
            return None
        std = np.sqrt(np.diag(self.log_covariance))
        return np.asarray(self.log_covariance / np.outer(std, std))

    @property
    def condition(self) -> float:
        """Condition number of d ln f / d ln factor (-); inf if a factor has no effect."""
        return float(np.linalg.cond(self.energy_share))

    @property
    def reduced_chi_square(self) -> float | None:
        """Chi-square per spare mode (-), about 1 if the model is right; None without errors or spare modes."""
        spare = self.frequency.size - self.factor.size
        return None if self.chi_square is None or spare == 0 else self.chi_square / spare

    def __str__(self) -> str:
        """Return the report."""
        lines = [*self._stiffness_lines(), *self._correlation_lines(), *self._mode_lines()]
        chi = self.reduced_chi_square
        if chi is not None:
            lines.append(f"reduced chi-square {chi:.3g} (about 1 if model and standard errors are right)")
        return "\n".join([*lines, *(f"warning: {remark}" for remark in self.remarks)])

    def _stiffness_lines(self) -> list[str]:
        width = max(map(len, self.groups))
        lines = []
        for index, (group, factor, stiffness) in enumerate(zip(self.groups, self.factor, self.stiffness, strict=True)):
            scale, unit = (1.0, "N m/rad") if is_tilting(self.spindles, group) else (1e6, "N/um")
            std = None if self.stiffness_std is None else float(self.stiffness_std[index])
            start = f"start {stiffness / factor / scale:.5g} {unit}"
            estimate = f"{format_with_error(stiffness, std, scale, unit, percent=True)} per part on average"
            known = f"{estimate}, {start}, calibration factor {factor:.5f}"
            text = f"not determined, {start}" if group in self.open_groups else known
            lines.append(f"stiffness {group:{width}}  {text}")
        return lines

    def _correlation_lines(self) -> list[str]:
        correlation = self.correlation
        if correlation is None or len(self.groups) == 1:
            return []
        pairs = zip(*np.triu_indices(len(self.groups), 1), strict=True)
        texts = (f"{self.groups[i]}-{self.groups[j]} {correlation[i, j]:.2f}" for i, j in pairs)
        return ["correlation " + ", ".join(texts)]

    def _mode_lines(self) -> list[str]:
        several = len(self.spindles) > 1
        head = "spindle, mode" if several else "mode"
        lines = [f"{head}  measured, fitted - measured, strain energy share of each group"]
        for index, number in enumerate(self.mode):
            std = None if self.frequency_std is None else float(self.frequency_std[index])
            energies = zip(self.groups, self.energy_share[index], strict=True)
            shares = ", ".join(f"{group} {100 * share:.1f} %" for group, share in energies)
            measured = format_with_error(float(self.frequency[index]), std, unit="Hz", percent=True)
            place = f"{self.shaft[index] + 1:7d}, {number:4d}" if several else f"{number:4d}"
            lines.append(f"{place}  {measured}, {self.residual[index]:+.2g} Hz, {shares}")
        return lines


class StiffnessFitError(ArithmeticError):
    """Raised if no minimum was found; holds the best estimate.

    Parameters
    ----------
    message : str
        Text of the error.
    best : StiffnessFit
        Best estimate; not reliable.
    """

    def __init__(self, message: str, best: StiffnessFit) -> None:
        super().__init__(message)
        self.best = best
        """Best estimate; not reliable."""


MIN_LOG_FACTOR_CHANGE = 1e-9
"""Smallest change of a factor (logarithm) for the error of a predicted mode."""


class PredictedMode(NamedTuple):
    """Mode of a spindle with the fitted bearings and joints."""

    frequency: float
    """Natural frequency (Hz)."""
    frequency_std: float | None
    """Standard error of the frequency from those of the stiffnesses (Hz); None if these are unknown."""
    stiffness: float
    """Modal stiffness at the position (N/m)."""
    stiffness_std: float | None
    """Standard error of the modal stiffness (N/m); None if those of the bearings are unknown."""


def predict_mode(fit: StiffnessFit, spindle: Spindle, mode: int = 1, position: float = 0.0) -> PredictedMode:
    """Predict a mode of another spindle with the fitted groups, such as one with a third tool.

    The errors are half the change between the ends of each principal axis of the factors' covariance, added in squares,
    and the effect of the drawing tolerance: diameters common with the fitted spindles act on both.

    Parameters
    ----------
    fit : StiffnessFit
        Fitted stiffnesses.
    spindle : Spindle
        Spindle with the stiffnesses that the fit started from.
    mode : int
        Number of the mode; 1 is the lowest.
    position : float
        Distance from the tool tip (m).

    Returns
    -------
    PredictedMode
        Frequency and modal stiffness with errors.

    Raises
    ------
    ValueError
        As modes_at.

    Examples
    --------
    >>> bearings = [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)]
    >>> tapped = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], bearings)
    >>> fit = fit_stiffness(tapped, [0.95 * natural_frequencies(tapped, 1)[0]], frequency_std=[2.0])
    >>> other = Spindle([Segment(0.1, 0.04), Segment(0.4, 0.06)], bearings)  # with a tool that was never tapped
    >>> mode = predict_mode(fit, other)
    >>> f"{mode.frequency:.0f} +- {mode.frequency_std:.0f} Hz, K = {mode.stiffness / 1e6:.1f} N/um"
    '921 +- 2 Hz, K = 33.2 N/um'
    """

    def of(shaft: Spindle) -> Floats:
        frequency, stiffness = modes_at(shaft, mode, position)
        return np.array([frequency[-1], stiffness[-1]])

    def at(log_factor: Floats) -> Floats:
        return of(scale_groups(spindle, dict(zip(fit.groups, np.exp(log_factor).tolist(), strict=True))))

    best = np.log(fit.factor)
    values = at(best)
    if fit.log_covariance is None:
        return PredictedMode(float(values[0]), None, float(values[1]), None)
    variance, axes = np.linalg.eigh(fit.log_covariance)
    sizes = np.clip(np.sqrt(np.maximum(variance, 0.0)), MIN_LOG_FACTOR_CHANGE, MAX_LOG_INTERVAL)
    changes = np.array([(at(best + step) - at(best - step)) / 2 for step in (axes * sizes).T])
    squares = np.sum(np.square(changes), axis=0)
    if fit.tolerance > 0 and fit.frequency_std is not None:
        slope = (axes / sizes) @ changes / values
        effects = _joint_diameter_effects(fit, fit.apply_to(spindle), of)
        squares = squares + values**2 * _diameter_variance(fit, effects, slope)
    errors = np.sqrt(np.maximum(squares, 0.0)).tolist()
    return PredictedMode(float(values[0]), errors[0], float(values[1]), errors[1])


def _joint_diameter_effects(
    fit: StiffnessFit, spindle: Spindle, values: Callable[[Spindle], Floats]
) -> tuple[Floats, Floats]:
    """Return the effects of all diameters on the modes of the fit (n, d), and on two values of a spindle (2, d)."""
    names = diameter_keys([*fit.spindles, spindle])
    order = diameter_columns(names)
    own = np.zeros((2, len(order)))
    own[:, [order[name] for name in names[-1]]] = diameter_effects(spindle, values, names[-1])
    fitted = frequency_effects(fit.spindles, fit.mode, fit.shaft, names)
    return fitted, own


def _diameter_variance(fit: StiffnessFit, effect: tuple[Floats, Floats], slope: Floats) -> Floats:
    """Return the part of the drawing in the relative variances (2,), including its effect on the fit.

    slope: d ln value / d ln factor, shape (g, 2).
    """
    fitted, own = effect
    relative = np.asarray(fit.frequency_std) / fit.frequency
    covariance = np.diag(relative**2) + fit.tolerance**2 * fitted @ fitted.T
    factors = np.asarray(fit.log_covariance)
    known = np.where(np.diag(factors) < MAX_LOG_INTERVAL**2, 1.0, 0.0)[:, np.newaxis]
    by_fit = slope.T @ (known * (factors @ (fit.energy_share / 2).T)) @ np.linalg.solve(covariance, fitted)
    return np.asarray(fit.tolerance**2 * np.sum(own**2 - 2 * by_fit * own, axis=1))
