"""What FRFs in x, in y and from x to y show of modes that lie askew."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from numpy.typing import ArrayLike

from lobes.milling_system import checked_vectors
from modal import Mode


class ShownModes(NamedTuple):
    """Modes as each FRF of the tool tip shows them; a direction that no mode moves in is empty."""

    x: list[Mode]
    """Modes hit and seen in x."""
    y: list[Mode]
    """Modes hit and seen in y."""
    cross: list[Mode]
    """Modes hit in x and seen in y; the stiffness is negative where y moves against x."""


def shown_modes(modes: Sequence[Mode], vectors: ArrayLike) -> ShownModes:
    """Modes with directions (n, 2) at the tip as zero order takes them: a residue u_a u_b / K from a to b.

    Raises ValueError for vectors that do not fit the modes.

    A mode of 20 N/um along its own axis, 30 degrees from x, is 26.7 N/um stiff in x and 80 N/um in y:

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> angle = np.radians(30.0)
    >>> shown = shown_modes([mode], [[np.cos(angle), np.sin(angle)]])
    >>> [round(modes[0].stiffness / 1e6, 1) for modes in (shown.x, shown.y, shown.cross)]  # N/um
    [26.7, 80.0, 46.2]
    """
    vector = checked_vectors(vectors, len(modes))
    pairs = (
        [(mode, float(u[a] * u[b])) for mode, u in zip(modes, vector, strict=True)] for a, b in ((0, 0), (1, 1), (0, 1))
    )
    return ShownModes(*([mode.scaled(1.0, 1 / share, "") for mode, share in shown if share] for shown in pairs))
