"""Largest residues that modes of one direction may have in the FRF of the other direction, by its lines."""

from collections.abc import Sequence

import numpy as np

from acquisition import Frf
from lobewatch.arrays import Floats
from lobewatch.measurement.series_questions import MAX_DAY
from lobewatch.measurement.tap_measurement import Measurement
from modal import Mode

MIN_BAND_SHARE, BAND_WIDTHS = 0.05, 8.0
"""Smallest half-width of the lines around a mode, over its frequency, and in half-power half-widths; chosen."""
MIN_LINES_PER_UNKNOWN = 2
"""Number of lines per fitted complex number below which nothing is said."""
CLAMPING_FREQUENCY_TOLERANCE = 0.003
"""Relative distance of two frequencies that reclamping explains."""
SHIFTS = CLAMPING_FREQUENCY_TOLERANCE * np.linspace(-1, 1, 5)
"""Relative frequency shifts of a mode from one tap test to the other that are tried."""
COVERAGE_FACTOR = 2.0
"""Number of standard errors added to the fitted residue (95 %)."""
NOISE_FLAT_POWER = {"receptance": 0, "mobility": 1, "accelerance": 2}
"""Power of the frequency that makes the noise of a receptance flat, by the measured quantity."""


def compare_directions(x: Measurement | None, y: Measurement | None) -> Floats | None:
    """Return the largest residues of the modes of x, then y, in the other FRF; None unless both are recent at the tip.

    The modes at the tip are those of the FRF only if it was tapped there.
    """
    if x is None or y is None or x.frf is None or y.frf is None or abs(x.time - y.time) > MAX_DAY:
        return None
    if not all(tap.at_tip and set(tap.used) <= set(tap.at_tip) for tap in (x, y)):
        return None
    in_y, in_x = find_hidden_residues(x.at_tip, y.at_tip, y.frf), find_hidden_residues(y.at_tip, x.at_tip, x.frf)
    return np.concatenate((in_y, in_x))


def find_hidden_residues(modes: Sequence[Mode], others: Sequence[Mode], frf: Frf) -> Floats:
    """Return upper limits of the residues of modes of one direction in the FRF of the other direction.

    Each mode is added to the modes of that FRF, whose poles and residues stay free to first order, with a linear
    background. The limit is the size of its residue and two standard errors, at the worst of the frequencies that
    reclamping allows. Correlated misfit counts as fewer lines. A mode that cannot be told from the other modes has a
    large limit.

    Parameters
    ----------
    modes
        Modes of one direction.
    others
        Modes fitted to the FRF of the other direction.
    frf
        That FRF.

    Returns
    -------
    ndarray
        Largest residues 1/K (m/N) at 95 %, shape (n,); inf where the lines do not tell.

    References
    ----------
    .. [1] Golub & Pereyra 1973, variable projection: the free poles as columns of derivatives.
    .. [2] Bayley & Hammersley 1946, effective number of correlated observations.
    """
    return np.array([_hidden_residue(mode, others, frf) for mode in modes])


def _hidden_residue(mode: Mode, others: Sequence[Mode], frf: Frf) -> float:
    width = max(BAND_WIDTHS * mode.damping_ratio, MIN_BAND_SHARE) * mode.frequency
    kept = np.abs(frf.frequency - mode.frequency) <= width
    line = frf.frequency[kept]
    near = [other for other in others if abs(other.frequency - mode.frequency) < width * (1 + other.damping_ratio)]
    columns = [np.ones(line.size), line / mode.frequency]
    for other in near:
        shape = _unit_receptance(line, other.frequency, other.damping_ratio)
        columns += [shape, line / other.frequency * shape, shape**2]
    if line.size < MIN_LINES_PER_UNKNOWN * (len(columns) + 1) or not line[0] < mode.frequency < line[-1]:
        return np.inf
    weight = (line / mode.frequency) ** NOISE_FLAT_POWER[frf.measured_as]
    free, _ = np.linalg.qr(weight[:, np.newaxis] * np.stack(columns, axis=1))
    left = weight * (frf.receptance[kept] - sum(other.receptance(line) for other in others))
    left -= free @ (free.conj().T @ left)
    limit = 0.0
    for frequency in mode.frequency * (1 + SHIFTS):
        own = weight * _unit_receptance(line, frequency, mode.damping_ratio)
        own -= free @ (free.conj().T @ own)
        size = np.vdot(own, own).real
        residue = np.vdot(own, left) / size
        noise = left - residue * own
        freedom = (line.size - len(columns) - 1) * _independent_share(noise)
        error = np.sqrt(np.vdot(noise, noise).real / max(freedom, 1.0) / size)
        limit = max(limit, abs(residue) + COVERAGE_FACTOR * float(error))
    return limit


def _unit_receptance(line: Floats, frequency: float, damping_ratio: float) -> np.ndarray:
    """Return the receptance of a mode of stiffness 1 at lines (Hz)."""
    ratio = line / frequency
    return np.asarray(1 / (1 - ratio**2 + 2j * damping_ratio * ratio))


def _independent_share(noise: np.ndarray) -> float:
    """Return the share of lines that count as independent, from the correlation of neighbours."""
    size = np.vdot(noise, noise).real
    near = np.vdot(noise[1:], noise[:-1]).real / size if size else 0.0
    return float((1 - max(near, 0.0)) / (1 + max(near, 0.0)))
