"""Bearing stiffness from natural frequencies, without a root search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.assemble import assemble
from dsm.count_below import count_below
from dsm.frequency_axis import frequency_axis
from dsm.spindle import Spindle


def stiffness_factor(spindle: Spindle, frequency: ArrayLike, mode: int = 1) -> NDArray[np.float64]:
    """Factor on all bearing stiffnesses that puts a mode (1 is the lowest) at each frequency; NaN where none does.

    frequency: (n,) Hz, > 0; shape of the result (n,). With R = B^T K_free(w)^-1 B the receptance of the free shaft
    at its bearings, each weighted with the root of its stiffness, w is a natural frequency where -1/factor is an
    eigenvalue of R. Of the eigenvalues in rising order, the one of mode n has the index N - n (the first is 0), N the
    number of modes of the free shaft below w: each bearing stiffness that passes through such a value moves one mode
    past w.
    """
    f = frequency_axis(frequency)
    if np.any(f == 0):
        raise ValueError("frequency=0 Hz is not > 0")
    places = [bearing.position for bearing in spindle.bearings]
    free = assemble(replace(spindle, bearings=()), float(np.max(f, initial=0.0)), places)
    w2 = (2 * np.pi * f) ** 2
    dofs = [2 * free.node(place) for place in places]
    root = np.sqrt([bearing.stiffness for bearing in spindle.bearings])
    forces = np.zeros((free.held.size, root.size))
    forces[dofs, np.arange(root.size)] = root
    compliance = root[:, np.newaxis] * np.linalg.solve(free.dense(w2), forces)[:, dofs]
    eigenvalues = np.linalg.eigvalsh((compliance + compliance.swapaxes(1, 2)) / 2)
    index = count_below(free, w2) - mode
    found = (index >= 0) & (index < root.size)
    value = eigenvalues[np.arange(f.size), np.where(found, index, 0)]
    return np.where(found & (value < 0), -1 / value, np.nan)
