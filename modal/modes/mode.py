"""A vibration mode as seen in one FRF, and the FRF of several modes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import scipy
from numpy.typing import ArrayLike

from acquisition import Frf, Remark
from modal.arrays import Complexes, Floats

UNKNOWN_PHASE_STD_DEG = 90.0
"""Standard error of an unknown phase (degrees)."""


@dataclass(frozen=True, eq=False)
class Mode:
    """Vibration mode: receptance (Re A + Im A (zeta + i r) / sqrt(1 - zeta^2)) / (1 - r^2 + 2i zeta r), r = f/f_n.

    A = exp(i phase) / K is its modal constant (m/N): in R / (i w - lambda) + conj(R) / (i w - conj(lambda)) with the
    pole lambda = -zeta w_n + i w_d the residue R is A w_n^2 / (2i w_d). A real mode has phase 0 and the receptance
    1/K / (1 - r^2 + 2i zeta r).

    The stiffness of a driving point is positive. A negative stiffness is legal: there the response moves against
    the hammer (`is_driving_point`).

    Raises
    ------
    ValueError
        For values that no mode has.

    References
    ----------
    Ewins, Modal Testing, ch. 2.6 (complex modes); docs/modal.md explains K of a complex mode.

    Examples
    --------
    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> round(mode.peak * 1e6, 3)  # um/N; 1 / (2 zeta K)
    1.25
    >>> mode.receptance(np.array([500.0])) * 2 * 0.02 * 2e7  # 1 / (2 i zeta K) at resonance
    array([0.-1.j])
    """

    frequency: float
    """Undamped natural frequency f_n (Hz)."""
    damping_ratio: float
    """Viscous damping ratio zeta (-)."""
    stiffness: float
    """Modal stiffness K between hammer and sensor (N/m), signed: 1/|A|, negative like Re A.

    NaN for a mode of free decays, whose force was not measured.
    """
    covariance: Floats | None = None
    """Covariance of (frequency, damping_ratio, stiffness) from the residual of the fit, SI units, shape (3, 3).

    The errors of neighbouring lines count as independent. With hits it includes the hammer noise, which is alike over
    many lines. None if not estimated.
    """
    degrees_of_freedom: float = np.inf
    """Degrees of freedom of that covariance: real values fitted less unknowns of the whole band."""
    method: str = ""
    """Method of identification."""
    jackknife: Floats | None = None
    """Covariance from the scatter of the hits, whatever their errors, shape (3, 3); None without hits."""
    n_hits: int = 0
    """Number of hits of the jackknife, of the FRF with the fewest."""
    scatter_freedom: float | None = None
    """Degrees of freedom of the jackknife covariance; None for n_hits - 1.

    More where the scatter of the hits is the smaller part of it (Welch-Satterthwaite).
    """
    phase_deg: float = 0.0
    """Phase of the modal constant times the sign of K (degrees), -90 to 90; 0 for a real mode."""
    phase_deg_std: float = 0.0
    """Standard error of that phase (degrees), of a real mode, too; 0 if it was not estimated."""
    phase_correlation: Floats | None = None
    """Correlations of the error of the phase with those of (frequency, damping_ratio, stiffness), shape (3,)."""
    coherence: float | None = None
    """Mean coherence between the half-power points; None if unknown."""
    misfit: float | None = None
    """Residual rms near the mode over the noise rms; 1 for a perfect fit."""
    misfit_share: float | None = None
    """Residual rms near the mode over the height of its peak."""
    edge_distance: float | None = None
    """Distance from the nearer end of the lines, in half-power half-widths zeta f_n."""
    remaining_decay: float | None = None
    """Share of the decay that is left when the record ends; None for an unknown record length."""
    half_power_damping: float | None = None
    """Damping ratio from the half-power width of the peak, for comparison; None without such a width."""
    shape: Floats | None = None
    """Mode shape over the FRFs of `fit_common_modes`, largest 1 or -1, first > 0, shape (p,); None for one FRF."""
    match_count: tuple[int, int] | None = None
    """Number of other FRFs with this mode, and number compared (`match_modes`); None without comparison."""
    relative_peak: float | None = None
    """Peak of receptance over the highest of the same free decays from one excitation; None if K is known."""
    remarks: tuple[Remark, ...] = ()
    """Reasons for doubt about the mode. docs/remarks.md lists their codes."""

    def __post_init__(self) -> None:
        """Check values and covariances."""
        for wrong in chain(self._wrong_values(), self._wrong_errors()):
            raise ValueError(wrong)

    def _wrong_values(self) -> Iterator[str]:
        for name, value in (("frequency", self.frequency), ("damping_ratio", self.damping_ratio)):
            if not (np.isfinite(value) and value > 0):
                yield f"{name}={value} is not a finite number > 0"
        if self.relative_peak is not None:
            if self.has_stiffness or not self.relative_peak > 0:
                yield (
                    f"relative_peak={self.relative_peak} with stiffness={self.stiffness} is invalid. "
                    "Give a peak > 0 and a stiffness of NaN."
                )
        elif not np.isfinite(self.stiffness) or self.stiffness == 0:
            yield f"stiffness={self.stiffness} is not a finite number other than 0 (N/m)"
        if not abs(self.phase_deg) <= 90:
            yield f"phase_deg={self.phase_deg} is not within -90 to 90 degrees. Change the sign of the stiffness."
        if self.phase_deg and self.damping_ratio >= 1:
            yield f"damping_ratio={self.damping_ratio} with phase_deg={self.phase_deg} is not below 1"

    def _wrong_errors(self) -> Iterator[str]:
        for name, matrix in (("covariance", self.covariance), ("jackknife", self.jackknife)):
            if matrix is not None and np.shape(matrix) != (3, 3):
                yield f"{name} has shape {np.shape(matrix)}, not (3, 3)"
        if not (np.isfinite(self.phase_deg_std) and self.phase_deg_std >= 0):
            yield f"phase_deg_std={self.phase_deg_std} is not a finite number >= 0"
        if not self.degrees_of_freedom > 0:
            yield f"degrees_of_freedom={self.degrees_of_freedom} is not a number > 0"
        if self.jackknife is not None and self.n_hits < 2:
            yield f"n_hits={self.n_hits} is below 2, the least for a jackknife covariance"

    @property
    def has_stiffness(self) -> bool:
        """True if K is known, that is, if the force was measured."""
        return not np.isnan(self.stiffness)

    @property
    def is_driving_point(self) -> bool:
        """False if hammer and sensor move against each other in this mode (negative stiffness)."""
        return not self.stiffness < 0

    @property
    def peak(self) -> float:
        """Receptance at resonance, 1 / (2 |K| zeta) (m/N); for free decays `relative_peak`."""
        absolute = float(1 / (2 * abs(self.stiffness) * self.damping_ratio))
        return absolute if self.relative_peak is None else self.relative_peak

    @property
    def constant(self) -> complex:
        """Modal constant A = exp(i phase) / K (m/N)."""
        return complex(np.exp(1j * np.radians(self.phase_deg)) / self.stiffness)

    @property
    def joint_covariance(self) -> Floats:
        """Covariance of (frequency, damping_ratio, stiffness, phase_deg), shape (4, 4); NaN where not estimated."""
        error = np.append(self.standard_error, self.phase_deg_std)
        correlation = np.eye(4)
        correlation[:3, :3] = self.correlation
        correlation[3, :3] = correlation[:3, 3] = 0.0 if self.phase_correlation is None else self.phase_correlation
        return np.asarray(correlation * np.outer(error, error))

    @property
    def best_covariance(self) -> Floats | None:
        """Covariance over the hits, or of the fit if there are no hits; None without both."""
        return self.covariance if self.jackknife is None else self.jackknife

    @property
    def standard_error(self) -> Floats:
        """Standard errors of (frequency Hz, damping_ratio, stiffness N/m), shape (3,); NaN if not estimated.

        From the hits if there are any, else from the fit.
        """
        return _root_of_diagonal(self.best_covariance)

    @property
    def fit_error(self) -> Floats:
        """Standard errors from `covariance`, with or without a jackknife, shape (3,); NaN if not estimated."""
        return _root_of_diagonal(self.covariance)

    @property
    def correlation(self) -> Floats:
        """Correlations of the errors, shape (3, 3); NaN if not estimated, 0 with a value that has no error."""
        if self.best_covariance is None:
            return np.full((3, 3), np.nan)
        correlation = ratio_or_zero(self.best_covariance, np.outer(self.standard_error, self.standard_error))
        np.fill_diagonal(correlation, 1.0)
        return correlation

    def quantile(self, level: float = 0.95) -> float:
        """Return the half-width of an interval in standard errors.

        Parameters
        ----------
        level : float
            Probability that the interval holds the true value (-).

        Returns
        -------
        float
            Quantile of Student's t (-).

        Raises
        ------
        ValueError
            For a level outside 0 to 1.
        """
        if not 0 < level < 1:
            raise ValueError(f"level={level} is not between 0 and 1")
        over_hits = self.n_hits - 1 if self.scatter_freedom is None else self.scatter_freedom
        freedom = self.degrees_of_freedom if self.jackknife is None else over_hits
        return float(scipy.special.stdtrit(freedom, (1 + level) / 2))

    def interval(self, level: float = 0.95) -> Floats:
        """Return the confidence intervals of frequency, damping ratio and stiffness.

        Student's t: with `scatter_freedom` (n_hits - 1 if unknown) over hits, else with those of the fit.

        Parameters
        ----------
        level : float
            Probability that an interval holds the true value (-).

        Returns
        -------
        ndarray, shape (3, 2)
            Lower and upper limit of each (Hz, -, N/m).
        """
        reach = self.quantile(level) * self.standard_error
        value = np.array([self.frequency, self.damping_ratio, self.stiffness])
        return np.stack([value - reach, value + reach], axis=1)

    def scaled(self, frequency: float, stiffness: float, method: str) -> "Mode":
        """Return the mode with scaled frequency and stiffness, covariances included.

        Parameters
        ----------
        frequency : float
            Factor on the natural frequency (-).
        stiffness : float
            Factor on the stiffness (-).
        method : str
            Text to be added to `method`.

        Returns
        -------
        Mode
            Scaled mode.
        """
        scale = np.outer(*2 * [np.array([frequency, 1.0, stiffness])])
        scaled = change_covariances(self, lambda covariance: covariance * scale)
        words = f"{self.method}, {method}".removeprefix(", ")
        return replace(scaled, frequency=self.frequency * frequency, stiffness=self.stiffness * stiffness, method=words)

    def receptance(self, frequency: Floats) -> Complexes:
        """Return the receptance of this mode alone.

        Parameters
        ----------
        frequency : ndarray
            Frequencies (Hz), any shape.

        Returns
        -------
        ndarray
            Receptance (m/N), same shape.
        """
        r, zeta, constant = np.asarray(frequency) / self.frequency, self.damping_ratio, self.constant
        turned = constant.imag * (zeta + 1j * r) / np.sqrt(1 - zeta**2) if constant.imag else 0.0
        return np.asarray((constant.real + turned) / (1 - r**2 + 2j * zeta * r))


def ratio_or_zero(value: Floats, error: Floats) -> Floats:
    """Return values over errors; 0 for a value without error."""
    return np.divide(value, error, out=np.zeros(value.shape), where=error != 0)


def change_covariances(mode: Mode, change: Callable[[Floats], Floats]) -> Mode:
    """Return the mode with both covariances changed, as far as they are known."""
    covariance, jackknife = (None if own is None else change(own) for own in (mode.covariance, mode.jackknife))
    return replace(mode, covariance=covariance, jackknife=jackknife)


def mode_remark(mode: Mode, code: str, text: str, cure: str = "") -> Remark:
    """Return a remark at the frequency of a mode."""
    return Remark(code, f"{mode.frequency:.0f} Hz", text, cure)


def add_remark(mode: Mode, code: str, text: str, cure: str) -> Mode:
    """Return the mode with one remark more."""
    return replace(mode, remarks=(*mode.remarks, mode_remark(mode, code, text, cure)))


def _root_of_diagonal(covariance: Floats | None) -> Floats:
    return np.full(3, np.nan) if covariance is None else np.sqrt(np.diag(covariance))


def synthesize_frf(modes: Sequence[Mode], frequency: ArrayLike) -> Frf:
    """Sum the receptances of modes.

    Parameters
    ----------
    modes : sequence of Mode
        Modes.
    frequency : array_like, shape (n,)
        Frequencies (Hz).

    Returns
    -------
    Frf
        Sum of the receptances.

    Raises
    ------
    ValueError
        For a frequency axis that Frf rejects.

    Examples
    --------
    >>> modes = [Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)]
    >>> frf = synthesize_frf(modes, np.arange(1.0, 1501.0))
    >>> round(float(abs(frf.receptance).max()) * 1e6, 2), int(frf.frequency[abs(frf.receptance).argmax()])  # um/N, Hz
    (1.25, 500)
    """
    f = np.asarray(frequency, dtype=np.float64)
    return Frf(f, sum((mode.receptance(f) for mode in modes), np.zeros(f.shape, complex)))
