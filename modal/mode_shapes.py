"""Complex mode shapes over the points of a structure, and the agreement of FRFs between the same two points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from acquisition import Frf, Hit
from modal.arrays import Complexes, Floats
from modal.bands.extract_modes import extract_modes
from modal.fit_modes import fit_constants
from modal.modes.match_modes import mac
from modal.modes.mode import Mode, change_covariances
from modal.tip_compliance import relative_motion_error


@dataclass(frozen=True, eq=False)
class ModeShape:
    """Mode shape over p points, the first of which is the driving point.

    Examples
    --------
    >>> shape = ModeShape(Mode(500.0, 0.02, 2e7), np.array([1.0, -0.5 + 0j]), np.diag([1e-4, 4e-4]))
    >>> (shape.mass_normalized.real * np.sqrt(2e7) / (2 * np.pi * 500)).round(3).tolist()  # phi = w_n / sqrt(K) there
    [1.0, -0.5]
    >>> round(shape.phase_collinearity, 3)  # all points move in phase or in opposition
    1.0
    """

    mode: Mode
    """Mode, with its stiffness at the driving point."""
    motion: Complexes
    """Motion of each point over that of the driving point (-), shape (p,)."""
    size_covariance: Floats
    """Covariance of the relative errors of the modal constants of the points (-), shape (p, p)."""

    @property
    def motion_error(self) -> Floats:
        """Standard errors of the motions, 0 for the driving point (-), shape (p,)."""
        return np.abs(self.motion) * relative_motion_error(self.size_covariance, 0)

    @property
    def mass_normalized(self) -> Complexes:
        """Mode shape for unit modal mass (kg^-1/2), shape (p,): the modal constants A w_n^2 are phi_i phi_0.

        Source: Ewins, Modal Testing, ch. 2 (mass-normalised mode shape).
        """
        at_tip = 2 * np.pi * self.mode.frequency * np.sqrt(self.mode.constant + 0j)
        return np.asarray(at_tip * self.motion)

    @property
    def phase_collinearity(self) -> float:
        """Modal phase collinearity (MPC): 1 if all points move in phase or in opposition, 0 for a travelling wave.

        It is the MAC of the shape and its conjugate. Source: Pappa, Elliott & Schenk (1993), Journal of Guidance,
        Control, and Dynamics 16, 860.
        """
        return mac(self.motion, self.motion.conj())

    @property
    def mean_phase_deviation_deg(self) -> float:
        """Mean deviation of the phases from the line that fits them best, weighted by the motions (degrees).

        Source: Heylen, Lammens & Sas, Modal Analysis Theory and Testing (mean phase deviation).
        """
        turned = self.motion * np.exp(-0.5j * np.angle(np.sum(self.motion**2)))
        phases = np.degrees(np.arctan2(np.abs(turned.imag), np.abs(turned.real)))
        return float(np.average(phases, weights=np.abs(turned)))


def fit_mode_shapes(
    frfs: Sequence[Frf], band: tuple[float, float] | None = None, hits: Sequence[Sequence[Hit]] = ()
) -> list[ModeShape]:
    """Fit complex mode shapes with common poles to the FRFs of several points.

    Parameters
    ----------
    frfs : sequence of Frf
        FRFs with one frequency axis, the driving point first: one response point moves, or the hammer moves.
    band : tuple of float, optional
        Lowest and highest frequency (Hz). Default: all usable lines.
    hits : sequence of sequences of Hit, optional
        For each FRF the hits that it was averaged from (H1), maybe none.

    Returns
    -------
    list of ModeShape
        Mode shapes by rising frequency; may be empty. All points have the errors of the fit. If the stiffness at
        the driving point scatters more over the hits, all are larger by its factor.

    Raises
    ------
    ValueError
        As `fit_common_modes`.

    Examples
    --------
    >>> line = np.arange(1.0, 1001.0)
    >>> frfs = [synthesize_frf([Mode(500.0, 0.02, stiffness)], line) for stiffness in (2e7, -4e7, 8e7)]
    >>> (shape,) = fit_mode_shapes(frfs)
    >>> shape.motion.real.round(3).tolist()
    [1.0, -0.5, 0.25]
    """
    return [_make_shape(*fitted) for fitted in fit_constants(extract_modes(frfs, band), hits)]


def _make_shape(mode: Mode, constants: Complexes, covariance: Floats) -> ModeShape:
    over_hits = float(mode.standard_error[2] / mode.fit_error[2])
    return ModeShape(mode, constants / constants[0], covariance * max(over_hits, 1.0) ** 2)


def average_points(shape: ModeShape, groups: Sequence[Sequence[int]]) -> ModeShape:
    """Average the repeated measurements of each point.

    Parameters
    ----------
    shape : ModeShape
        Mode shape over measurements.
    groups : sequence of sequences of int
        Indices of the measurements of each point, the driving point first.

    Returns
    -------
    ModeShape
        Mode shape over points, 1 at the driving point, with the mean modal constant there. Its errors include the
        scatter of the measurements.
    """
    share = np.zeros((len(groups), shape.motion.size))
    for place, group in enumerate(groups):
        share[place, [*group]] = 1 / len(group)
    mean = share @ shape.motion
    steps = share * np.abs(shape.motion) / np.maximum(np.abs(mean), np.finfo(float).tiny)[:, np.newaxis]
    scatter = [_relative_scatter(shape.motion[[*group]]) for group in groups]
    covariance = steps @ shape.size_covariance @ steps.T + np.diag(np.square(scatter))
    mode = _multiply_constant(shape.mode, complex(mean[0]), scatter[0])
    return replace(shape, mode=mode, motion=mean / mean[0], size_covariance=covariance)


def _multiply_constant(mode: Mode, factor: complex, relative_error: float) -> Mode:
    """Multiply the modal constant by a factor with a relative error of its own."""
    turned = mode.phase_deg + float(np.degrees(np.angle(factor)))
    half_turns = round(turned / 180)
    stiffness = mode.stiffness / abs(factor) * (-1) ** half_turns
    scale, added = np.diag([1, 1, stiffness / mode.stiffness]), np.diag([0, 0, (relative_error * stiffness) ** 2])
    changed = change_covariances(mode, lambda covariance: scale @ covariance @ scale + added)
    return replace(changed, stiffness=stiffness, phase_deg=turned - 180 * half_turns)


def _relative_scatter(values: Complexes) -> float:
    """Return the relative standard error of a mean by its values; 0 for a single one."""
    if values.size == 1:
        return 0.0
    return float(np.std(values, ddof=1) / np.sqrt(values.size) / max(abs(np.mean(values)), np.finfo(float).tiny))


def mac_matrix(first: Sequence[ArrayLike], second: Sequence[ArrayLike]) -> Floats:
    """Return the modal assurance criterion of each mode shape of one set with each of another.

    Parameters
    ----------
    first, second : sequence of array_like, shape (p,)
        Mode shapes over the same points.

    Returns
    -------
    ndarray, shape (m, n)
        MAC, 1 for the same shape; the auto-MAC for one set twice.

    Raises
    ------
    ValueError
        As `mac`.

    Examples
    --------
    >>> mac_matrix([[1.0, 1.0], [1.0, -1.0]], [[2.0, 2.0]]).tolist()
    [[1.0], [0.0]]
    """
    return np.array([[mac(a, b) for b in second] for a in first]).reshape(len(first), len(second))


class FrfAgreement(NamedTuple):
    """Agreement of two FRFs between the same points."""

    frac: float
    """Frequency response assurance criterion (FRAC), 0 to 1: 1 for the same form."""
    scale: float
    """Second FRF over the first by least squares (-); negative for opposite signs."""


def compare_frfs(first: Frf, second: Frf, band: tuple[float, float] | None = None) -> FrfAgreement:
    """Compare two FRFs of the same two points, repeated or with hammer and sensor exchanged (reciprocity).

    Parameters
    ----------
    first, second : Frf
        FRFs with one frequency axis.
    band : tuple of float, optional
        Lowest and highest frequency (Hz). Default: the usable band of both.

    Returns
    -------
    FrfAgreement
        Form and scale, in mobility, which weights no end of the band.

    References
    ----------
    Heylen & Lammens (1996), FRAC: a consistent way of comparing frequency response functions; Ewins, Modal Testing.

    Examples
    --------
    >>> line = np.arange(1.0, 1001.0)
    >>> tip, other = (synthesize_frf([Mode(500.0, 0.02, stiffness)], line) for stiffness in (2.2e7, -2e7))
    >>> agreement = compare_frfs(tip, other)
    >>> round(agreement.frac, 3), round(agreement.scale, 3)
    (1.0, -1.1)
    """
    for limits in (band, first.usable_band, second.usable_band):
        first, second = first.in_band(limits), second.in_band(limits)
    a, b = first.mobility, second.mobility
    return FrfAgreement(mac(a, b), float(np.vdot(a, b).real / np.vdot(a, a).real))
