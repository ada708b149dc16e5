"""Natural frequencies of a spinning beam, none missed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.spinning.beam import SpinningBeam
from dsm.spinning.element import angular_speed
from dsm.spinning.modes import spinning_modes


class UnstableSpinError(ArithmeticError):
    """Modes that grow at this speed instead of lasting: mostly between the critical speeds of the two planes.

    >>> pins = [(place, dof) for place in (0.0, 0.5) for dof in ("u", "v")]
    >>> flat = SpinningBeam([SpinningSegment(0.5, 1e4, 2e4, 15.0)], held=pins)
    >>> f_x, f_y = (np.pi / (2 * 0.5**2) * np.sqrt(rigidity / 15.0) for rigidity in (2e4, 1e4))
    >>> spinning_frequencies(flat, 1, 60 * (f_x + f_y) / 2)
    Traceback (most recent call last):
        ...
    dsm.spinning.frequencies.UnstableSpinError: at speed_rpm=11749.8 1 mode(s) grow instead of lasting ...
    """

    def __init__(self, message: str, frequency: NDArray[np.float64], unstable: int, proved: int) -> None:
        """Keep what is known beside the message."""
        super().__init__(message)
        self.frequency = frequency
        """The lowest frequencies of the other modes, as many as were asked for (Hz)."""
        self.unstable = unstable
        """Number of modes that grow."""
        self.proved = proved
        """How many of them are proved to. Each frequency is proved; that none is missed only if all these are."""


def spinning_frequencies(beam: SpinningBeam, count: int, speed_rpm: float) -> NDArray[np.float64]:
    """The `count` lowest natural frequencies (Hz) seen in the frame that turns with the beam, (count,), ascending.

    speed_rpm: speed of spin (rpm), >= 0. Euler-Bernoulli theory: no rotary inertia, no gyroscopic moments. A round
    beam is solved as two planar ones, of frequencies f_n: |f_n -+ speed_rpm/60|. Otherwise each mode is proved by
    its step of the number of negative eigenvalues of the stiffness matrix, and by their sum that none is missed
    (see spinning_modes).

    Raises ValueError for a count below 1, a negative speed or a beam that can move without bending;
    UnstableSpinError where modes grow; ArithmeticError at a critical speed of a beam that is not round, and where
    modes cannot be proved.

    A round pinned beam, of f_1 = 162.2 Hz at rest, seen from the shaft at 3000 rpm: f_1 -+ 50 Hz.

    >>> pins = [(place, dof) for place in (0.0, 0.5) for dof in ("u", "v")]
    >>> beam = SpinningBeam([SpinningSegment(0.5, 1e4, 1e4, 15.0)], held=pins)
    >>> round(float(np.pi / (2 * 0.5**2) * np.sqrt(1e4 / 15.0)), 1)  # Hz
    162.2
    >>> spinning_frequencies(beam, 2, 3000.0).round(1).tolist()
    [112.2, 212.2]
    """
    if count < 1:
        raise ValueError(f"{count} modes were asked for; at least 1 is needed")
    spin = angular_speed(speed_rpm)
    if not beam.is_supported:
        raise ValueError("the beam can move without bending in a plane; hold more dofs or give more springs")
    if beam.is_round:
        return _round_beam(beam, count, spin) / (2 * np.pi)
    w, proved, unstable = spinning_modes(beam, count, spin)
    frequency = w / (2 * np.pi)
    if unstable:
        raise UnstableSpinError(
            f"at speed_rpm={speed_rpm:g} {unstable} mode(s) grow instead of lasting ({proved} proved by counting); "
            "choose a speed below the critical ones, or take the other modes from `frequency` of this error",
            frequency,
            unstable,
            proved,
        )
    return frequency


def _round_beam(beam: SpinningBeam, count: int, spin: float) -> NDArray[np.float64]:
    """|w_n - W| and w_n + W (rad/s) of so many planar modes that no later one can come lower."""
    n = count
    while True:
        planar = spinning_modes(beam, 2 * n, 0.0)[0][::2]
        w = np.sort(np.concatenate([np.abs(planar - spin), planar + spin]))[:count]
        if planar[-1] - spin >= w[-1]:
            return w
        n *= 2
