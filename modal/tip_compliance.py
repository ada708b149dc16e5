"""Shares of the parts of a spindle in the compliance of a mode at the tool tip."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modal.arrays import Floats

MAX_STRAIGHT_RESIDUAL = 2.0
"""Distance of a point from the line of its part, in standard errors, up to which the part is straight; 95 %."""
MIN_POINT_ERROR = 1e-3
"""Least error of a point, over the motion of the tip: exact shapes have no error; chosen."""


BENDING_ERROR = 0.02
"""Standard error of a share because parts bend between their points, if all shares are positive.

It grows with the square of the sum of their sizes, measured on simulated spindles (docs/studies/shapes.md).
"""


class PartShare(NamedTuple):
    """Share of one part, or of several parts that the points cannot separate."""

    parts: tuple[str, ...]
    """Names of the parts, from the tip on."""
    share: float
    """Share of the tip motion and of the compliance 1/K (-); negative if the part moves the tip backwards."""
    standard_error: float
    """Standard error of the share (-)."""


def compliance_shares(
    position: ArrayLike, part: Sequence[str], motion: ArrayLike, size_covariance: ArrayLike
) -> list[PartShare]:
    """Divide the motion of the tool tip in a mode, and so its compliance 1/K there, into shares of the parts.

    A straight line through the front points of a part says how the tip would move if everything between this part and
    the tip were rigid. The difference of the tip motions of two neighbouring parts is the deformation of the part in
    front, with its clamping in the part behind. The last part has the rest: its motion as a rigid body.

    These shares s of all modes and parts divide the static compliance of the tip: the sum of s/K over all modes is
    d C / d ln f, f the flexibility of the part (Castigliano: the tip moves by the deformation of each part under a
    force at the tip). For one mode it is the change of the tip motion with f under unchanged inertia forces. The share
    in the strain energy of a mode is another figure: it weights the deformation by the moment of the inertia forces.

    Parameters
    ----------
    position : array_like, shape (p,)
        Distances from the tool tip along the axis (m); the smallest is the tip.
    part : sequence of str
        Part of each point.
    motion : array_like, shape (p,)
        Motion of each point in phase with the tip, over that of the tip (-).
    size_covariance : array_like, shape (p, p)
        Covariance of the relative errors of the modal constants (-).

    Returns
    -------
    list of PartShare
        Shares from the tip on, which add up to 1. A part with a single point has no slope: it shares a row with the
        part in front.

    Raises
    ------
    ValueError
        For two points of a part at one position.

    References
    ----------
    Rivin, Stiffness and Damping in Mechanical Design (breakdown of the deformation at the tool).

    Examples
    --------
    A rigid spindle turns about a point 0.3 m behind the tip, and a tool bends by a quarter of the tip motion:

    >>> shares = compliance_shares([0.0, 0.1, 0.2], ["tool", "spindle", "spindle"], [1, 0.5, 0.25], np.zeros((3, 3)))
    >>> [(*row.parts, round(row.share, 3)) for row in shares]
    [('tool', 0.25), ('spindle', 0.75)]
    """
    z, w, covariance = (np.asarray(values, dtype=np.float64) for values in (position, motion, size_covariance))
    tip, rows = int(np.argmin(z)), list[tuple[list[str], Floats]]()
    sigma = np.maximum(np.abs(w) * relative_motion_error(covariance, tip), MIN_POINT_ERROR)
    for name in dict.fromkeys(part[i] for i in np.argsort(z)):
        own = [int(i) for i in np.argsort(z) if part[i] == name]
        if not rows:
            rows.append(([name], np.eye(z.size)[tip]))
        elif len(own) == 1:
            rows[-1][0].append(name)
        else:
            rows.append(([name], _extrapolate_to_tip(z - z[tip], w, sigma, own)))
    behind = [row for _, row in rows[1:]] + [np.zeros(z.size)]
    pairs = [(tuple(parts), row - other) for (parts, row), other in zip(rows, behind, strict=True)]
    shares = [float(row @ w) for _, row in pairs]
    bending = BENDING_ERROR * float(np.sum(np.abs(shares))) ** 2 if len(pairs) > 1 else 0.0
    errors = [math.hypot(_share_error(row * w, covariance, tip), bending) for _, row in pairs]
    names = [parts for parts, _ in pairs]
    return [PartShare(*row) for row in zip(names, shares, errors, strict=True)]


def _extrapolate_to_tip(z: Floats, w: Floats, sigma: Floats, own: Sequence[int]) -> Floats:
    """Return the weights of the points in the tip motion of the line through the front points of a part.

    The line has as many points as are straight within their errors, at least two.
    """
    weights = np.zeros(z.size)
    for count in range(len(own), 1, -1):
        front = [*own[:count]]
        if np.ptp(z[front]) <= 0:
            raise ValueError(f"two points of a part are at {z[front[0]]:g} m. Measure at two positions.")
        columns = np.stack([np.ones(count), z[front]]) / sigma[front]
        line = np.linalg.pinv(columns.T) / sigma[front]
        residual = w[front] - np.stack([np.ones(count), z[front]]).T @ line @ w[front]
        if count == 2 or np.all(np.abs(residual) <= MAX_STRAIGHT_RESIDUAL * sigma[front]):
            weights[front] = line[0]
            break
    return weights


def _share_error(parts: Floats, covariance: Floats, tip: int) -> float:
    """Return the standard error of a sum of motions (p,), each of which is divided by that of the tip."""
    slope = parts - np.sum(parts) * (np.arange(parts.size) == tip)
    return math.sqrt(max(float(slope @ covariance @ slope), 0.0))


def relative_motion_error(size_covariance: Floats, tip: int) -> Floats:
    """Return the relative standard error of each motion over that of the tip; 0 for the tip, shape (p,)."""
    own, common = np.diag(size_covariance), size_covariance[tip]
    return np.asarray(np.sqrt(np.maximum(own + own[tip] - 2 * common, 0.0)))
