"""Modes of the tool tip as one system: directions, projections, frequency drop."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from acquisition import Frf
from lobes.coefficients import check_number
from lobes.tip_response import TipModes, check_modes
from modal import Mode
from modal.arrays import Complexes, Floats, Integers

MAX_UNDERDAMPED_RATIO = 0.99
"""Largest damping ratio of a complex mode; a larger one, as of a sample, is replaced by it."""


@dataclass(frozen=True, eq=False)
class MillingSystem:
    """System of n modes in p compliant directions: q'' + 2 zeta w q' + w^2 q = shape vector . F.

    The tip displacement is d = sum shape vector (place q + velocity q' / w), see `tip_participation`; shape vector q
    for
    real modes.
    """

    frequency: Floats
    """Natural frequencies w (rad/s), shape (n,)."""
    damping_ratio: Floats
    """Damping ratios zeta, shape (n,)."""
    shape: Floats
    """Mass-normalized mode shapes at the tool tip, w / sqrt(K) (kg^-1/2), shape (n,)."""
    phase: Floats
    """Phases of the modal constants (rad), shape (n,); 0 for real modes."""
    direction: Integers
    """Row of `axes` in which each mode was measured, shape (n,)."""
    vector: Floats
    """Directions of the modes in `axes`, shape (n, p): share of force and response. 1 and 0 along an axis."""
    axes: Integers
    """Compliant directions, 0 for x (feed) and 1 for y (normal), shape (p,)."""

    def receptance(self, frequency: Floats) -> Complexes:
        """Return the receptance (m/N) at frequencies (Hz) of any shape, shape (..., p, p)."""
        omega = 2 * np.pi * frequency
        total = np.zeros((*omega.shape, self.axes.size, self.axes.size), dtype=np.complex128)
        shares = tip_participation(self.damping_ratio, self.phase)
        modes = zip(self.frequency, self.damping_ratio, self.shape, *shares, self.vector, strict=True)
        for w, zeta, shape, place, velocity, vector in modes:
            shown = shape**2 * (place + 1j * velocity * omega / w if velocity else place)
            flexible = np.asarray(shown / (w**2 - omega**2 + 2j * zeta * w * omega))
            total += flexible[..., np.newaxis, np.newaxis] * np.outer(vector, vector)
        return total


def tip_participation(damping_ratio: Floats, phase: Floats) -> tuple[Floats, Floats]:
    """Return the shares of a mode's coordinate q and of its velocity q' / w in the tip displacement.

    1 and 0 for phase 0; phases in rad.

    y = (cos + sin zeta / sqrt(1 - zeta^2)) q + sin / sqrt(1 - zeta^2) q' / w has the receptance of `modal.Mode`.
    """
    velocity = np.sin(phase) / np.sqrt(1 - np.minimum(damping_ratio, MAX_UNDERDAMPED_RATIO) ** 2)
    return np.cos(phase) + velocity * damping_ratio, velocity


def build_milling_system(x: TipModes, y: TipModes, vectors: ArrayLike | None = None) -> MillingSystem:
    """Build the system of the modes in the feed (x) and normal (y) direction.

    Parameters
    ----------
    x, y : sequence of Mode, or None
        Modes of each direction; None for a rigid or unknown direction.
    vectors : array_like, shape (n, 2), optional
        Parts in x and y of the direction of each mode of x, then of y; a unit vector if the stiffness is that along its
        own axis. Default: each mode is along its direction.

    Returns
    -------
    MillingSystem
        Joint system.

    Raises
    ------
    ValueError
        For FRFs, two rigid directions, an empty list, modes of negative stiffness, and vectors that do not fit the
        modes.

    Examples
    --------
    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> system = build_milling_system([mode], [mode])
    >>> at_resonance = system.receptance(np.array(500.0))  # m/N, (2, 2): 1 / (2 i zeta K) on the diagonal
    >>> (at_resonance * 2 * 0.02 * 2e7).round(6).tolist()
    [[-1j, 0j], [0j, -1j]]
    """
    given = [(axis, name, modes) for axis, name, modes in ((0, "x", x), (1, "y", y)) if modes is not None]
    if not given:
        raise ValueError("x and y are both None. Give the modes of at least one direction.")
    for _, name, modes in given:
        if isinstance(modes, Frf):
            raise ValueError(f"{name} is an FRF, but semi-discretisation needs modes. Fit modes with modal.fit_modes.")
        check_modes(modes, name)
    modes = [mode for _, _, group in given for mode in group]
    direction = np.repeat(np.arange(len(given)), [len(group) for _, _, group in given])
    axes = np.array([axis for axis, _, _ in given])
    vector = np.eye(axes.size)[direction] if vectors is None else check_directions(vectors, len(modes))
    frequency = 2 * np.pi * np.array([mode.frequency for mode in modes])
    return MillingSystem(
        frequency=frequency,
        damping_ratio=np.array([mode.damping_ratio for mode in modes]),
        shape=frequency / np.sqrt([mode.stiffness for mode in modes]),
        phase=np.radians([mode.phase_deg for mode in modes]),
        direction=direction if vectors is None else axes[direction],
        vector=vector,
        axes=axes if vectors is None else np.arange(2),
    )


def check_directions(vectors: ArrayLike, number: int) -> Floats:
    """Return the directions of the modes, shape (n, 2); ValueError if shape or values are wrong."""
    vector = np.asarray(vectors, dtype=np.float64)
    if vector.shape != (number, 2):
        needed = f"Give shape ({number}, 2), the x and y components of each mode."
        raise ValueError(f"vectors has shape {vector.shape}. {needed}")
    if not np.all(np.isfinite(vector)):
        raise ValueError("vectors has a value that is not finite. Give the x and y components of each mode.")
    return vector


class ProjectedModes(NamedTuple):
    """Modes as each FRF of the tool tip shows them; empty for a direction that no mode moves in."""

    x: list[Mode]
    """Modes hit and measured in x."""
    y: list[Mode]
    """Modes hit and measured in y."""
    cross: list[Mode]
    """Modes hit in x and measured in y; negative stiffness if y moves against x."""


def project_modes(modes: Sequence[Mode], vectors: ArrayLike) -> ProjectedModes:
    """Project modes with rotated principal directions on the axes: a residue u_a u_b / K from a to b.

    Parameters
    ----------
    modes : sequence of Mode
        Modes along their own directions.
    vectors : array_like, shape (n, 2)
        Directions at the tool tip.

    Returns
    -------
    ProjectedModes
        Modes of the FRFs in x, in y, and from x to y.

    Raises
    ------
    ValueError
        For vectors that do not fit the modes.

    Examples
    --------
    A mode of 20 N/um along its own axis, 30 degrees from x, has 26.7 N/um in x and 80 N/um in y:

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> angle = np.radians(30.0)
    >>> shown = project_modes([mode], [[np.cos(angle), np.sin(angle)]])
    >>> [round(modes[0].stiffness / 1e6, 1) for modes in (shown.x, shown.y, shown.cross)]  # N/um
    [26.7, 80.0, 46.2]
    """
    vector = check_directions(vectors, len(modes))
    pairs = ([(m, float(u[a] * u[b])) for m, u in zip(modes, vector, strict=True)] for a, b in ((0, 0), (1, 1), (0, 1)))
    return ProjectedModes(*([mode.scaled(1.0, 1 / share, "") for mode, share in shown if share] for shown in pairs))


StiffnessRule = Literal["measured", "model", "paper"]
"""Rule for the stiffness of a mode whose frequency has dropped."""


def age_mode(baseline: Mode, ratio: float, rule: StiffnessRule, stiffness_ratio: float | None = None) -> Mode:
    """Return a mode after a frequency drop, with the damping of the baseline and K by a rule.

    The covariance is scaled along.

    Parameters
    ----------
    baseline : Mode
        Mode before the drop.
    ratio : float
        New frequency over old (-).
    rule : {"measured", "model", "paper"}
        "measured": K times `stiffness_ratio` of a new tap test. "model": K times `stiffness_ratio` of a recalibrated
        model; without one K stays, and `method` says so. "paper": K times `ratio`, as Gaber & Hashemi (2015) assume.
    stiffness_ratio : float, optional
        New stiffness over old (-).

    Returns
    -------
    Mode
        Mode after the drop.

    Raises
    ------
    ValueError
        For ratios <= 0 and a stiffness_ratio that does not go with the rule.

    Examples
    --------
    >>> new = Mode(frequency=1000.0, damping_ratio=0.03, stiffness=2e7)
    >>> old = age_mode(new, 0.9, "paper")
    >>> round(old.frequency), round(old.stiffness / 1e6, 1)  # Hz, N/um
    (900, 18.0)
    >>> old = age_mode(new, 0.9, "measured", stiffness_ratio=0.85)
    >>> round(old.frequency), round(old.stiffness / 1e6, 1)
    (900, 17.0)
    """
    if rule not in get_args(StiffnessRule):
        known = ", ".join(get_args(StiffnessRule))
        raise ValueError(f"rule={rule!r} is not one of {known}. Choose how stiffness K changes with f1.")
    for name, value in (("ratio", ratio), ("stiffness_ratio", 1.0 if stiffness_ratio is None else stiffness_ratio)):
        check_number(name, value, "is not a finite number > 0. Give the new value divided by the old value.")
    if rule == "measured" and stiffness_ratio is None:
        raise ValueError(
            'rule="measured" needs stiffness_ratio. Give stiffness K of the new tap test over that of the baseline.'
        )
    if rule == "paper" and stiffness_ratio is not None:
        raise ValueError(f'rule="paper" computes stiffness K. Leave stiffness_ratio={stiffness_ratio} out.')
    softer = ratio if rule == "paper" else 1.0 if stiffness_ratio is None else stiffness_ratio
    rule_text = "K constant, no model" if rule == "model" and stiffness_ratio is None else f"K by rule {rule}"
    return baseline.scaled(ratio, softer, f"aged, {rule_text}")
