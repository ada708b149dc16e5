"""Natural frequencies, mode shapes and modal stiffness of a spindle."""

import numpy as np
from numpy.typing import ArrayLike

from dsm.arrays import Floats
from dsm.modes.find_modes import find_modes
from dsm.modes.modes import Modes
from dsm.spindle.segment import SAME_PLACE
from dsm.spindle.spindle import Spindle


def natural_frequencies(spindle: Spindle, count: int, rigid_bearings: bool = False) -> Floats:
    """Compute the lowest bending frequencies of a spindle, proved complete.

    Without rotary inertia and shear, and with equal bearing stiffness in all directions, the frequencies seen from
    the housing do not depend on speed.

    Parameters
    ----------
    spindle : Spindle
        Spindle.
    count : int
        Number of frequencies.
    rigid_bearings : bool
        Exact limit of infinitely stiff bearings, which hold the deflection but not the slope.

    Returns
    -------
    ndarray, shape (count,)
        Natural frequencies (Hz), rising; 0 for motions without bending.

    Raises
    ------
    ValueError
        For count < 1.
    ArithmeticError
        If rounding spoils the count of modes.

    Examples
    --------
    A shaft on two knife edges, f_n = n^2 pi / (2 L^2) sqrt(E I / (rho A)):

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> natural_frequencies(shaft, 3).round(1).tolist()  # Hz
    [406.2, 1624.9, 3656.0]
    >>> [round(float(n**2 * np.pi / (2 * 0.5**2) * np.sqrt(210e9 / 7850)) * 0.05 / 4, 1) for n in (1, 2, 3)]
    [406.2, 1624.9, 3656.0]
    """
    held = [(bearing.position, 0) for bearing in spindle.bearings] if rigid_bearings else []
    return find_modes(spindle, count, held=held).frequency


def modes_at(spindle: Spindle, count: int, position: float = 0.0) -> tuple[Floats, Floats]:
    """Compute natural frequencies and modal stiffness at one place.

    The receptance there is the sum over all modes of 1/K/(1 - (f/f_n)^2).

    Parameters
    ----------
    spindle : Spindle
        Spindle.
    count : int
        Number of modes.
    position : float
        Distance from the tool tip (m).

    Returns
    -------
    frequency : ndarray, shape (count,)
        Natural frequencies (Hz).
    stiffness : ndarray, shape (count,)
        Modal stiffness (N/m); 0 for a motion without bending, inf at a node of the mode.

    Raises
    ------
    ValueError
        For a position off the shaft, and as natural_frequencies.

    Examples
    --------
    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> frequency, stiffness = modes_at(shaft, 2, position=0.125)
    >>> frequency.round(1).tolist(), (stiffness / 1e6).round(1).tolist()  # Hz, N/um
    ([406.2, 1624.9], [50.2, 401.7])
    """
    modes = find_modes(spindle, count, places=[position])
    return modes.frequency, modes.stiffness_at(position)


def modal_stiffness(spindle: Spindle, mode: int = 1, position: float = 0.0) -> float:
    """Compute the modal stiffness K of one mode at one place.

    A peak of the measured FRF gives this, not the static stiffness: |H| = 1/(2 zeta K).

    Parameters
    ----------
    spindle : Spindle
        Spindle.
    mode : int
        Number of the mode; 1 is the lowest.
    position : float
        Distance from the tool tip (m).

    Returns
    -------
    float
        Modal stiffness (N/m).

    Raises
    ------
    ValueError
        For a mode below 1, and as modes_at.

    Examples
    --------
    For a shaft on two knife edges half the mass moves with its middle:

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> w = 2 * np.pi * natural_frequencies(shaft, 1)[0]
    >>> round(modal_stiffness(shaft, 1, position=0.25) / 1e6, 2)  # N/um
    25.1
    >>> round(float(shaft.mass / 2 * w**2) / 1e6, 2)
    25.1
    """
    if mode < 1:
        raise ValueError(f"mode={mode} is not at least 1, the lowest")
    return float(modes_at(spindle, mode, position)[1][-1])


def mode_shapes(spindle: Spindle, count: int, places: ArrayLike | None = None) -> Modes:
    """Compute the lowest modes with deflection and slope at some places.

    Exact everywhere, inside long segments too. A joint has two sides; at its place the values are those of the side
    away
    from the tool tip. With theory="timoshenko" the slope is the rotation of the cross-section.

    Parameters
    ----------
    spindle : Spindle
        Spindle.
    count : int
        Number of modes.
    places : array_like, shape (n,), optional
        Distances from the tool tip (m), any order. Default: segment ends, bearings, masses and joints.

    Returns
    -------
    Modes
        Modes at these places.

    Raises
    ------
    ValueError
        For a place off the shaft, and as natural_frequencies.

    Examples
    --------
    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> modes = mode_shapes(shaft, 1, [0.125, 0.25, 0.375])
    >>> abs(modes.deflection[0] / modes.deflection[0, 1]).round(3).tolist()  # sin(pi z / L)
    [0.707, 1.0, 0.707]
    """
    modes = find_modes(spindle, count)
    if places is None:
        return modes
    position = np.asarray(places, dtype=np.float64)
    if position.ndim != 1:
        raise ValueError(f"places has shape {position.shape}. Give a 1-D array (m).")
    slack = SAME_PLACE * spindle.length
    off = position[~((position >= -slack) & (position <= spindle.length + slack))]
    if off.size:
        raise ValueError(f"places has {off[0]} m, not on the shaft (0 to {spindle.length:g} m)")
    return modes.at(np.clip(position, 0.0, spindle.length))
