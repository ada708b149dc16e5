"""Modes of several FRFs with the same poles: directions, or points of a structure."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition import Frf, Hit
from modal.bands.extract import extract
from modal.fit_modes import modes_of
from modal.modes.mode import Mode


def fit_points(
    frfs: Sequence[Frf], band: tuple[float, float] | None = None, hits: Sequence[Sequence[Hit]] = ()
) -> list[Mode]:
    """Modes that all these FRFs share, by rising frequency, each with its shape; maybe none.

    The extraction of `fit_modes` with common frequencies and damping ratios, and a modal constant and residual terms
    for each FRF: a mode counts where one of the FRFs shows it. They have one frequency axis; the first is the driving
    point, which stiffness and covariance belong to, and shape holds the modal constants of all, relative to the
    largest.

    hits: for each FRF those that it was averaged from (H1), maybe none; noise of the hammer counts where they are
    given. Where all have three or more, the modes have a jackknife that leaves out one hit of one FRF at a time,
    which takes the FRFs for measured independently. Its n_hits is that of the FRF with the fewest.

    Raises ValueError as `fit_modes`, for no FRF, for FRFs with different lines, and for another number of lists of
    hits than FRFs.

    >>> line = np.arange(1.0, 1001.0)
    >>> tip, nose = synthesize([Mode(500.0, 0.02, 2e7)], line), synthesize([Mode(500.0, 0.02, -4e7)], line)
    >>> (mode,) = fit_points([tip, nose])
    >>> f"{mode.frequency:.1f} Hz, K = {mode.stiffness / 1e6:.1f} N/um, shape {mode.shape.round(3).tolist()}"
    '500.0 Hz, K = 20.0 N/um, shape [1.0, -0.5]'
    """
    return modes_of(extract(frfs, band), hits)
