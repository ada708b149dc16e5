"""What fitting several stiffnesses to several modes found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsm.calibration.fit_remark import FitRemark
from dsm.calibration.plus_minus import plus_minus
from dsm.calibration.stiffness_groups import group_stiffness, is_tilting, scale_groups
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]

OPEN = ("group-not-felt", "stiffness-ambiguous")
"""Codes of the remarks that leave a stiffness open."""


@dataclass(frozen=True, eq=False)
class StiffnessFit:
    """Spindles whose groups of bearings and joints, each scaled by a factor, put modes at measured frequencies.

    n modes, g groups, one spindle or several that share them. Standard errors are of first order in those of the
    frequencies. They hold for the logarithm of a factor too: an error of 10 % is 0.1 there. Printed, it is a report.
    """

    groups: tuple[str, ...]
    """Names of the groups."""
    mode: NDArray[np.int_]
    """Numbers of the measured modes, shape (n,); 1 is the lowest."""
    frequency: _Float
    """Measured frequencies (Hz), shape (n,)."""
    frequency_std: _Float | None
    """Their standard errors (Hz), shape (n,); None where they were not given."""
    fitted_frequency: _Float
    """Frequencies of the fitted spindle (Hz), shape (n,)."""
    factor: _Float
    """Stiffness after over before (-), shape (g,)."""
    log_covariance: _Float | None
    """Covariance of the logarithms of the factors (-), shape (g, g); None: no errors given, and no mode to spare.

    Propagated from the standard errors of the frequencies, whatever the residuals are. Where none were given, from
    the scatter of the residuals, taken as errors of equal size in relation to the frequency.
    """
    energy_share: _Float
    """Share of each group in the strain energy of each mode (-), shape (n, g); twice d ln f / d ln factor."""
    remarks: tuple[FitRemark, ...]
    """Remarks on what makes the result doubtful, and what to do about it."""
    shaft: NDArray[np.int_]
    """Number of the spindle that each mode was measured on, shape (n,); 0 is the first."""
    given: tuple[Spindle, ...]
    """The spindles as given."""
    spindles: tuple[Spindle, ...]
    """The fitted spindles."""
    chi_square: float | None
    """Sum of squares of the residuals over their errors, those of the drawing included (-); None: no errors given."""
    tolerance: float
    """Relative standard error of each diameter of the drawing (-)."""

    @property
    def spindle(self) -> Spindle:
        """The fitted spindle, the first of several."""
        return self.spindles[0]

    def applied_to(self, spindle: Spindle) -> Spindle:
        """A spindle with the stiffnesses that the fit started from, its groups scaled by the factors found."""
        return scale_groups(spindle, dict(zip(self.groups, self.factor.tolist(), strict=True)))

    @property
    def open_groups(self) -> frozenset[str]:
        """Groups whose stiffness the measured modes leave open, as the remarks say."""
        about = [remark.about for remark in self.remarks if remark.code in OPEN]
        return frozenset(name for entry in about for name in ([entry] if entry in self.groups else self.groups))

    @property
    def misfits(self) -> bool:
        """Whether the frequencies do not fit one another, far beyond their errors."""
        return any(remark.code == "frequencies-misfit" for remark in self.remarks)

    @property
    def residual(self) -> _Float:
        """Fitted less measured frequency (Hz), shape (n,)."""
        return np.asarray(self.fitted_frequency - self.frequency)

    @property
    def factor_std(self) -> _Float | None:
        """Standard error of the factors (-), shape (g,); None where there is no covariance."""
        if self.log_covariance is None:
            return None
        return np.asarray(self.factor * np.sqrt(np.diag(self.log_covariance)))

    @property
    def stiffness(self) -> _Float:
        """Mean radial stiffness of the parts of each group after the fit (N/m), shape (g,).

        Of a group of stiffnesses against tilting alone it is their mean (N m/rad).

        An equivalent number of this model: compare it only with others of the same geometry and beam theory.
        """
        return np.array([group_stiffness(self.spindles, group) for group in self.groups])

    @property
    def stiffness_std(self) -> _Float | None:
        """Its standard error (N/m), shape (g,); None where there is no covariance."""
        std = self.factor_std
        return None if std is None else np.asarray(self.stiffness * std / self.factor)

    @property
    def correlation(self) -> _Float | None:
        """Correlations of the factors (-), shape (g, g); None where there is no covariance."""
        if self.log_covariance is None:
            return None
        std = np.sqrt(np.diag(self.log_covariance))
        return np.asarray(self.log_covariance / np.outer(std, std))

    @property
    def condition(self) -> float:
        """Largest over smallest singular value of d ln f / d ln factor (-); inf where a factor has no effect at all."""
        return float(np.linalg.cond(self.energy_share))

    @property
    def reduced_chi_square(self) -> float | None:
        """Mean square of residual over standard error, per mode to spare (-), about 1 where the model is right.

        None where no standard errors were given or there is no mode to spare.
        """
        spare = self.frequency.size - self.factor.size
        return None if self.chi_square is None or spare == 0 else self.chi_square / spare

    def __str__(self) -> str:
        """The report."""
        return "\n".join([*self._stiffness_lines(), *self._correlation_lines(), *self._mode_lines(), *self._notes()])

    def _stiffness_lines(self) -> list[str]:
        width = max(map(len, self.groups))
        lines = []
        for index, (group, factor, stiffness) in enumerate(zip(self.groups, self.factor, self.stiffness, strict=True)):
            scale, unit = (1.0, "N m/rad") if is_tilting(self.spindles, group) else (1e6, "N/um")
            std = None if self.stiffness_std is None else float(self.stiffness_std[index])
            start = f"start {stiffness / factor / scale:.5g} {unit}"
            estimate = f"{plus_minus(stiffness, std, scale, unit, percent=True)} each on average"
            text = f"open, {start}" if group in self.open_groups else f"{estimate}, {start}: factor {factor:.5f}"
            lines.append(f"stiffness {group:{width}}  {text}")
        return lines

    def _correlation_lines(self) -> list[str]:
        correlation = self.correlation
        if correlation is None or len(self.groups) == 1:
            return []
        pairs = zip(*np.triu_indices(len(self.groups), 1), strict=True)
        return [
            "correlation " + ", ".join(f"{self.groups[i]}-{self.groups[j]} {correlation[i, j]:.2f}" for i, j in pairs)
        ]

    def _mode_lines(self) -> list[str]:
        several = len(self.spindles) > 1
        head = "spindle, mode" if several else "mode"
        lines = [f"{head}  measured, fitted less measured, share of each group in the strain energy"]
        for index, number in enumerate(self.mode):
            std = None if self.frequency_std is None else float(self.frequency_std[index])
            shares = ", ".join(
                f"{group} {100 * share:.1f} %"
                for group, share in zip(self.groups, self.energy_share[index], strict=True)
            )
            measured = plus_minus(float(self.frequency[index]), std, unit="Hz", percent=True)
            place = f"{self.shaft[index] + 1:7d}, {number:4d}" if several else f"{number:4d}"
            lines.append(f"{place}  {measured}, {self.residual[index]:+.2g} Hz, {shares}")
        return lines

    def _notes(self) -> list[str]:
        chi = self.reduced_chi_square
        lines = (
            [] if chi is None else [f"reduced chi-square {chi:.3g}: about 1 where model and standard errors are right"]
        )
        return [*lines, *(f"warning: {remark}" for remark in self.remarks)]


class StiffnessFitError(ArithmeticError):
    """No minimum was found; the best estimate is kept."""

    def __init__(self, message: str, best: StiffnessFit) -> None:
        """Keep the estimate beside the message."""
        super().__init__(message)
        self.best = best
        """The best estimate; not to be trusted."""
